/** Linear system of a model about an operating point: time constants, gains, files and figures. */

import { download, getJson } from "../lib/api.js";
import { el, runOnceAtATime } from "../lib/dom.js";
import { showProblem } from "./banner.js";
import { makeFigure } from "./figures.js";

/** Significant digits of a level that is not given. */
const DIGITS = 6;

const FIGURES = ["bode", "nyquist", "pole-map", "unit-step"];

/** Files of the system: their name, form and notation. */
const FILES = [
  ["State space, MATLAB", "state-space", "matlab"],
  ["State space, JSON", "state-space", "json"],
  ["Transfer function, MATLAB", "transfer-function", "matlab"],
  ["Transfer function, text", "transfer-function", "text"],
];

/** Make the form of an operating point; `change(point)` is called with the parameters of the given levels. */
function makePointForm(names, change) {
  const fields = names.map((name) => el("input", { type: "number", step: "any", name }));
  const labels = fields.map((field) => el("label", { class: "level" }, field.name, field));
  const node = el("form", { class: "row point" }, labels, el("button", { type: "submit" }, "Linearise there"));
  node.addEventListener("submit", (event) => {
    event.preventDefault();
    const given = fields.filter(({ value }) => value !== "");
    change(given.map(({ name, value }) => ["at", `${name}=${value}`]));
  });
  return {
    node,
    /** Show the operating point of a system where nothing is given. */
    show({ inputs, outputs, operating_inputs: levels, operating_outputs: rest }) {
      const known = new Map([...inputs, ...outputs].map((name, at) => [name, [...levels, ...rest][at]]));
      for (const field of fields) field.placeholder = Number(known.get(field.name).toPrecision(DIGITS));
    },
  };
}

/** Make the choice of the time of the files, with its check box. */
function makeTimeChoice() {
  const box = el("input", { type: "checkbox", name: "continuous" });
  const text = "Files in continuous time (inputs held between samples)";
  return { box, node: el("label", { class: "check" }, box, ` ${text}`) };
}

/** Make what a system about an operating point has: words, files and figures. */
function makeContent(path, system, point, signal) {
  const time = makeTimeChoice();
  const save = (form, notation) =>
    runOnceAtATime(() => {
      const query = new URLSearchParams([...point, ["form", form], ["notation", notation]]);
      if (time.box.checked) query.set("continuous", "zoh");
      return download(`${path}?${query}`, "system.txt").catch(showProblem);
    });
  const query = `?${new URLSearchParams(point)}`;
  const buttons = FILES.map(([name, form, notation]) =>
    el("button", { type: "button", on: { click: save(form, notation) } }, name),
  );
  return [
    el("ul", { class: "modes" }, system.words.map((text) => el("li", {}, text))),
    el("div", { class: "row exports", role: "group", "aria-label": "Save the linear system as" }, buttons),
    time.node,
    el("div", { class: "gallery" }, FIGURES.map((name) => makeFigure(path, name, signal, query))),
  ];
}

/** Make the section of the model at a path, of a job with inputs and outputs; it loads when it is opened. */
export function makeLinearSystem(path, { inputs, output }, signal) {
  const address = `${path}/linear-system`;
  // An input that acts at once has a suffix behind the name of its column.
  const names = [...inputs.map((name) => name.replace(/\+1$/, "")), ...[output].flat()];
  const form = makePointForm(names, load);
  const body = el("div", { class: "linear" });
  const title = el("summary", {}, "Linear system: Bode, Nyquist, poles, step, state space");
  const node = el("details", { class: "search" }, title, form.node, body);
  let controller = new AbortController();

  async function load(point = []) {
    controller.abort();
    controller = new AbortController();
    const shown = AbortSignal.any([signal, controller.signal]);
    body.replaceChildren(el("p", { class: "loading", role: "status" }, "Loading…"));
    try {
      const system = await getJson(`${address}?${new URLSearchParams(point)}`, { signal: shown });
      form.show(system);
      body.replaceChildren(...makeContent(address, system, point, shown));
    } catch (error) {
      const complaint = el("p", { class: "complaint", role: "alert" }, error.message);
      if (!shown.aborted) body.replaceChildren(complaint);
    }
  }

  node.addEventListener("toggle", () => load(), { once: true });
  return node;
}
