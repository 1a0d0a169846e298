/** "Try it": the response of a model to inputs of choice, while their sliders move. */

import { postJson, saveBlob } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";
import { formatNumber, formatShort, labelQuantity } from "../lib/numbers.js";
import { makeLineChart } from "./chart.js";
import { makeExcitationForm } from "./excitation_form.js";
import { findLimits, makeLoopPlot } from "./loop_plot.js";
import { makeScenarioUpload, writeTable } from "./scenario_upload.js";

/** Periods of the first input that are shown at first, and limits of the number of samples. */
const [PERIODS, LEAST_SAMPLES, USUAL_SAMPLES, MOST_SAMPLES] = [5, 200, 10_000, 50_000];

/** Return a typical frequency of an input in Hz: half of its passes through its mean per second. */
function findFrequency(values, dt) {
  const duration = values.length * dt;
  const mean = values.reduce((sum, value) => sum + value, 0) / values.length;
  const passes = values.filter((value, at) => at && value > mean !== values[at - 1] > mean).length;
  return Math.min(Math.max(passes, 2) / (2 * duration), 0.05 / dt);
}

/** Make the controls and the plots of a model; `found` is its response to the inputs of the record. */
function makePanel(path, output, found, signal) {
  const { dt, ranges, units } = found;
  const names = Object.keys(ranges);
  const label = (name) => labelQuantity(name, units[name]);
  const getFrequency = (name) => findFrequency(found.inputs[name], dt);
  const frequency = getFrequency(names[0]);
  const forms = names.map((name, place) => {
    const [kind, rate] = [place ? "hold" : "sine", { dt, frequency: getFrequency(name) }];
    const input = { place, name, unit: units[name], range: ranges[name], kind, ...rate };
    return makeExcitationForm(input, update);
  });
  const usual = Math.min(USUAL_SAMPLES, Math.max(LEAST_SAMPLES, Math.round(PERIODS / frequency / dt)));
  const samples = el("input", {
    ...{ type: "number", id: "try-samples", min: 2, max: MOST_SAMPLES, value: usual, required: true },
    on: { input: update },
  });
  const time = { label: "time (s)", describe: (at) => `${formatShort(Number(at.toPrecision(6)))} s` };
  const response = makeLineChart({ title: "Response", x: time, y: { label: label(output) } }, signal);
  const excitation = makeLineChart({ title: "Input", x: time, y: { label: "" } }, signal);
  const loop = makeLoopPlot("Output over input", signal);
  const status = el("p", { class: "small" });
  const warnings = el("ul", { class: "warnings" });
  const start = el("p", { class: "soft small" });
  const save = el("button", { type: "button", disabled: true, on: { click: saveCsv } }, "Save as CSV");
  let [answer, isWanted, isRunning] = [found, false, false];

  function makeRequest() {
    const excitations = forms.map((form) => form.getExcitation());
    if (excitations.includes(null) || !samples.checkValidity()) return null;
    return {
      inputs: Object.fromEntries(names.map((name, at) => [name, excitations[at]])),
      samples: samples.valueAsNumber,
    };
  }

  /**
   * Request the response to the present values. While a request runs, later changes make one further request:
   * an abort at each change would show nothing until the slider rests.
   */
  async function update() {
    isWanted = true;
    if (isRunning) return;
    isRunning = true;
    while (isWanted && !signal.aborted) {
      isWanted = false;
      const request = makeRequest();
      if (request === null) showProblem("A value is missing or out of its range.");
      else
        try {
          show(await postJson(`${path}/simulate`, request, { signal }));
        } catch (error) {
          if (!signal.aborted) showProblem(error.message);
        }
    }
    isRunning = false;
  }

  function showProblem(text) {
    setText(status, text);
    status.classList.add("complaint");
  }

  function show(next) {
    answer = next;
    save.disabled = false;
    status.classList.remove("complaint");
    const values = next.outputs[output];
    const limits = findLimits(values);
    const range = limits?.map((each) => formatNumber(each)).join(" to ");
    setText(status, range ? `${output}: ${range} ${units[output]}`.trim() : `${output} diverges at once.`);
    if (next.warnings.join("\n") !== [...warnings.children].map((item) => item.textContent).join("\n"))
      warnings.replaceChildren(...next.warnings.map((text) => el("li", {}, text)));
    const initial = `${next.start.slice(0, 1).toUpperCase()}${next.start.slice(1)}.`;
    setText(start, initial);
    const moving = forms.findIndex((form) => !form.isConstant());
    const driving = names[Math.max(0, moving)];
    response.draw([{ name: output, x: next.time_s, y: values }]);
    excitation.draw([{ name: label(driving), x: next.time_s, y: next.inputs[driving] }]);
    loop.draw(
      { label: label(driving), values: next.inputs[driving] },
      { label: label(output), values },
    );
  }

  function saveCsv() {
    const headings = ["t_s", ...Object.keys(answer.inputs), output];
    const table = writeTable(headings, [answer.time_s, ...Object.values(answer.inputs), answer.outputs[output]]);
    saveBlob(new Blob([table], { type: "text/csv" }), "response.csv");
  }

  update();
  const length = el("div", { class: "slider" }, el("label", { for: samples.id }, "Samples"), samples);
  const controls = el("form", { class: "controls" }, forms.map(({ node }) => node), length, save);
  controls.addEventListener("submit", (event) => event.preventDefault());
  return [
    controls,
    el(
      "div",
      { class: "responses" },
      el("div", { role: "status" }, status, warnings),
      el("div", {}, response.node, excitation.node),
      el("div", {}, loop.node, start),
    ),
  ];
}

/** Make the button that opens the section, and the section, of a model at a path. */
export function makeTryModel(path, { inputs, output }, signal) {
  const host = el("div", { class: "try", id: "try", role: "group", "aria-label": "Try it", hidden: true });
  const states = { type: "button", "aria-expanded": "false", "aria-controls": host.id };
  const button = el("button", { class: "strong", ...states, on: { click: toggle } }, "Try it");

  async function load() {
    host.replaceChildren(el("p", { class: "loading", role: "status" }, "Loading…"));
    try {
      // An input that acts at once has a suffix behind the name of its column.
      const recorded = inputs.map((name) => [name.replace(/\+1$/, ""), { kind: "record" }]);
      const request = { inputs: Object.fromEntries(recorded), samples: USUAL_SAMPLES };
      const found = await postJson(`${path}/simulate`, request, { signal });
      if (!Object.keys(found.ranges).length)
        throw new Error("The result is of an earlier version, without ranges of inputs: identify again.");
      host.replaceChildren(
        ...makePanel(path, output, found, signal),
        makeScenarioUpload(path, [output], signal),
      );
    } catch (error) {
      const complaint = el("p", { class: "complaint", role: "alert" }, error.message);
      if (!signal.aborted) host.replaceChildren(complaint);
    }
  }

  function toggle() {
    host.hidden = !host.hidden;
    button.setAttribute("aria-expanded", String(!host.hidden));
    if (!host.hidden && !host.querySelector("form")) load();
  }

  return el("div", {}, el("div", { class: "row" }, button), host);
}
