/** What a job works on: the data set at a glance, and the settings of the search. */

import { Problem, json } from "./api.js";
import { el, facts, scrolled, table } from "./dom.js";
import { bytes, count, number, short } from "./numbers.js";
import { repeat } from "./watch.js";

const STATISTICS = ["Least", "Greatest", "Mean", "Deviation"];

function columns({ preview }, spec) {
  const remarks = preview.columns.some((column) => column.problem);
  const role = (name) => {
    if (name === preview.time) return "time";
    if (name === spec.output) return "output";
    // `u_V+1` is the column one sample early.
    return spec.inputs.some((input) => input === name || input.replace(/\+\d+$/, "") === name) ? "input" : "";
  };
  return table(
    "Columns of the data set",
    ["Column", "Unit", "Role", ...STATISTICS.map((name) => [name, "figure"]), ...(remarks ? ["Remark"] : [])],
    preview.columns.map((column) => [
      el("code", {}, column.name),
      column.unit,
      role(column.name),
      number(column.minimum),
      number(column.maximum),
      number(column.mean),
      number(column.deviation),
      ...(remarks ? [column.problem] : []),
    ]),
  );
}

function described(dataset, spec) {
  const { preview } = dataset;
  return [
    facts([
      ["File", dataset.name],
      ["Size", bytes(dataset.bytes)],
      ["Samples", count(preview.samples)],
      ["Sampling time", preview.dt === null ? null : `${short(preview.dt)} s`],
    ]),
    ...preview.warnings.map((warning) => el("p", { class: "complaint" }, warning)),
    scrolled("Columns of the data set", columns(dataset, spec)),
  ];
}

/** Show the data set of a job; `known(unit)` hears of the output's unit. */
export function datasetPanel(spec, known, signal) {
  const body = el("div", {}, el("p", { class: "waiting" }, "Asking the service…"));
  repeat(async () => {
    try {
      const dataset = await json(`v1/datasets/${encodeURIComponent(spec.dataset)}`, { signal });
      body.replaceChildren(...described(dataset, spec));
      known(dataset.preview.columns.find((column) => column.name === spec.output)?.unit ?? "");
    } catch (error) {
      if (!(error instanceof Problem) || error.status !== 404) throw error;
      body.replaceChildren(el("p", { class: "soft" }, "The data set was deleted."));
      known("");
    }
    return Infinity;
  }, signal);
  return el("section", { class: "card" }, el("h2", {}, "Data set"), body);
}

function validation({ validation: given }) {
  if (given === undefined) return "default";
  if (typeof given === "number") return `the last ${short(100 * given)} %`;
  return [`data set ${given.dataset}`, given.rows && `rows ${given.rows}`].filter(Boolean).join(", ");
}

/** Show what a job asks for; what it leaves open is the service's default. */
export function settingsPanel(spec) {
  const changed = Object.entries(spec.settings ?? {}).map(([name, value]) => [
    el("code", {}, name),
    Array.isArray(value) ? value.join(", ") : String(value),
  ]);
  return el(
    "section",
    { class: "card" },
    el("h2", {}, "Settings"),
    facts([
      ["Inputs", spec.inputs.join(", ")],
      ["Output", spec.output],
      ["Preset", spec.preset ?? "default"],
      ["Seed", String(spec.seed ?? "default")],
      ["Rows", spec.rows],
      ["Sampling time", spec.dt ? `${short(spec.dt)} s` : null],
      ["Validated on", validation(spec)],
      ...changed,
    ]),
  );
}
