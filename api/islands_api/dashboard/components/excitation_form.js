/** Controls of one input of a simulation: kind of excitation, and a slider with a number field per value. */

import { el } from "../lib/dom.js";
import { formatShort } from "../lib/numbers.js";

/** Excitations of the service, with their values. */
const KINDS = {
  sine: ["Sine", "amplitude", "offset", "frequency"],
  triangle: ["Triangle", "amplitude", "offset", "frequency"],
  steps: ["Steps", "amplitude", "offset", "frequency"],
  sweep: ["Sweep", "amplitude", "offset", "first", "last"],
  hold: ["Constant", "value"],
  record: ["Input of the record", "scale", "shift"],
};

/** Fields of a request that have another name here, because their ranges differ. */
const REQUESTED = { shift: "offset" };

/** Number of steps of a slider, and decades of the frequency below half the sampling frequency. */
const [STEPS, DECADES] = [200, 5];

const round = (value) => Number(value.toPrecision(4));

/** Return the values: name, unit, limits of the slider and default, from the range of the estimation data. */
function listValues({ unit, range: [low, high], dt, frequency }) {
  const [half, middle] = [(high - low) / 2 || Math.abs(high) || 1, (low + high) / 2];
  const level = { unit, least: low - half, most: high + half, start: middle };
  const rate = { unit: "Hz", most: 0.5 / dt, least: 0.5 / dt / 10 ** DECADES, isLog: true };
  return {
    amplitude: { label: "Amplitude", unit, least: 0, most: round(2 * half), start: half },
    offset: { label: "Offset", ...level },
    value: { label: "Value", ...level },
    frequency: { label: "Frequency", ...rate, start: frequency },
    first: { label: "First frequency", ...rate, start: frequency / 2 },
    last: { label: "Last frequency", ...rate, start: Math.min(4 * frequency, rate.most) },
    scale: { label: "Factor", unit: "", least: 0, most: 2, start: 1 },
    shift: { label: "Shift", unit, least: -half, most: half, start: 0 },
  };
}

/** Make a slider and a number field with one value; `onChange` is called when it changes. */
export function makeSliderField(id, { label, unit, least, most, start, isLog = false }, onChange) {
  const [to, from] = isLog ? [Math.log10, (at) => 10 ** at] : [Number, Number];
  const [low, high] = [to(least), to(most)];
  const slider = el("input", { type: "range", "aria-label": label, min: 0, max: STEPS });
  const field = el("input", { type: "number", id, step: "any", required: true });
  // Frequencies have limits; other values may leave the slider, and the service warns of them.
  if (isLog) [field.min, field.max] = [Number.MIN_VALUE, most];
  function show(value, isTyped = false) {
    slider.value = (STEPS * (to(value) - low)) / (high - low);
    slider.setAttribute("aria-valuetext", `${formatShort(value)} ${unit}`.trim());
    if (!isTyped) field.value = value;
  }
  slider.addEventListener("input", () => {
    show(Math.min(round(from(low + (slider.value / STEPS) * (high - low))), most));
    onChange();
  });
  field.addEventListener("input", () => {
    if (field.checkValidity()) show(field.valueAsNumber, true);
    onChange();
  });
  show(Math.min(round(start), most));
  return {
    node: el(
      "div",
      { class: "slider" },
      el("label", { for: id }, label, unit && el("span", { class: "soft" }, ` (${unit})`)),
      slider,
      field,
    ),
    isValid: () => field.checkValidity(),
    getValue: () => field.valueAsNumber,
  };
}

/**
 * Make the controls of an input with `place`, `name`, `unit`, `range` in the estimation data, `dt`, a typical
 * `frequency` and initial `kind`; `getExcitation()` returns the entry of the request, null if a value is not
 * valid.
 */
export function makeExcitationForm(input, onChange) {
  const { place, name, unit, kind } = input;
  const id = (value) => `try-${place}-${value}`;
  const fields = Object.fromEntries(
    Object.entries(listValues(input)).map(([value, settings]) => [
      value,
      makeSliderField(id(value), settings, onChange),
    ]),
  );
  const options = Object.entries(KINDS).map(([value, [text]]) =>
    el("option", { value, selected: value === kind }, text));
  const select = el("select", { id: id("kind"), on: { change: update } }, options);
  const host = el("div", { class: "sliders" });
  const getNames = () => KINDS[select.value].slice(1);

  function show() {
    host.replaceChildren(...getNames().map((value) => fields[value].node));
  }

  function update() {
    show();
    onChange();
  }

  show();
  return {
    node: el(
      "fieldset",
      {},
      el("legend", {}, el("bdi", {}, name), unit && el("span", { class: "soft" }, ` (${unit})`)),
      el("div", { class: "slider" }, el("label", { for: id("kind") }, "Signal"), select),
      host,
    ),
    isConstant: () => select.value === "hold",
    getExcitation: () =>
      getNames().every((value) => fields[value].isValid())
        ? {
            kind: select.value,
            ...Object.fromEntries(
              getNames().map((value) => [REQUESTED[value] ?? value, fields[value].getValue()]),
            ),
          }
        : null,
  };
}
