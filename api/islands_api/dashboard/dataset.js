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
    const among = (given = []) => given.some((each) => each === name || each.replace(/\+\d+$/, "") === name);
    if (among(spec.inputs ?? [spec.input])) return "input";
    if (among(spec.channels)) return "channel";
    return spec.simulation?.column === name ? "simulation" : "";
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

/** What a simulation is: its kind, and what it was given. */
function simulated({ kind, name, column, ...given }) {
  const parameters = Object.entries(given.parameters ?? {}).map(
    ([each, value]) => `${each} = ${short(value)}`,
  );
  return [kind, name ?? column, parameters.join(", ")].filter(Boolean).join(": ");
}

/** What a discrepancy job asks for beside what all do. */
const against = ({ simulation, channels = [], tolerance = {} }) => [
  ["Simulation", simulated(simulation)],
  ["Channels", channels.join(", ")],
  ...Object.entries(tolerance).map(([name, value]) => [`Tolerance of ${name}`, `${short(100 * value)} %`]),
];

/** What an identification asks for beside what all do. */
const searched = (spec) => [
  ["Preset", spec.preset ?? "default"],
  ["Validated on", validation(spec)],
];

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
      ["Inputs", (spec.inputs ?? [spec.input]).join(", ")],
      ["Output", spec.output],
      ...(spec.simulation ? against(spec) : searched(spec)),
      ["Seed", String(spec.seed ?? "default")],
      ["Rows", spec.rows],
      ["Sampling time", spec.dt ? `${short(spec.dt)} s` : null],
      ...changed,
    ]),
  );
}
