/** Panels of the data set and the settings of a job. */

import { Problem, getDatasetPath, getJson } from "../lib/api.js";
import { el, makeFacts, makeScrollable, makeTable } from "../lib/dom.js";
import { formatBytes, formatCount, formatNumber, formatShort } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";
import { getNotes, makeNoteText } from "./record_notes.js";

/** Headings of the statistics of a column. */
export const STATISTICS = ["Minimum", "Maximum", "Mean", "Std. deviation"];

/** Return the input columns of a job; none for a record, whose monitor names them. */
const getInputs = ({ inputs, input }) => inputs ?? (input === undefined ? [] : [input]);

/** Return the output columns of a job; none for a record, whose monitor names it. */
const getOutputs = ({ output }) => (output === undefined ? [] : [output].flat());

/** Return the unit of the output; empty if it is unknown, or if several outputs have different units. */
export function findUnit(columns, spec) {
  const names = getOutputs(spec);
  const units = new Set(columns.filter(({ name }) => names.includes(name)).map(({ unit }) => unit));
  return units.size === 1 ? [...units][0] : "";
}

/** Return why a column cannot be used, or how many values it lacks; empty if neither applies. */
export function describeDefect({ problem, missing }) {
  // Data sets of earlier versions do not count missing values.
  return problem || (missing ? `${formatCount(missing)} missing` : "");
}

function makeColumnTable({ preview }, spec) {
  const hasRemarks = preview.columns.some(describeDefect);
  const role = (name) => {
    if (name === preview.time) return "time";
    if (getOutputs(spec).includes(name)) return "output";
    // `u_V+1` is the column `u_V` advanced by one sample.
    const includesColumn = (names = []) =>
      names.some((each) => each === name || each.replace(/\+\d+$/, "") === name);
    if (includesColumn(getInputs(spec))) return "input";
    if (includesColumn(spec.channels)) return "channel";
    return spec.simulation?.column === name ? "simulation" : "";
  };
  return makeTable(
    "Columns of the data set",
    [
      ...["Column", "Unit", "Role"],
      ...STATISTICS.map((name) => [name, "figure"]),
      ...(hasRemarks ? ["Remark"] : []),
    ],
    preview.columns.map((column) => [
      el("code", {}, el("bdi", {}, column.name)),
      column.unit,
      role(column.name),
      formatNumber(column.minimum),
      formatNumber(column.maximum),
      formatNumber(column.mean),
      formatNumber(column.deviation),
      ...(hasRemarks ? [describeDefect(column)] : []),
    ]),
  );
}

/** Facts that are shown only if they state a problem. */
const ONLY_PROBLEMS = ["quantisation", "saturation", "levels"];

/** Kinds of irregular time stamps, and their sentences. */
const IRREGULAR = {
  gaps: "Samples are missing before",
  repeated: "A time stamp is repeated at",
  backward: "The time goes back at",
};

/** Rows of a kind that are listed. */
const LISTED = 3;

/** State how regular the time stamps are; data sets of earlier versions have no sampling. */
function listIrregularities({ jitter, counts = {}, ...rows }) {
  const percent = formatNumber(100 * jitter, 2);
  const steps = jitter >= 1e-3 ? [`The steps of the time vary by ${percent} % rms.`] : [];
  const kinds = Object.entries(IRREGULAR).filter(([kind]) => rows[kind]?.length);
  return steps.concat(
    kinds.map(([kind, text]) => {
      const listed = rows[kind].slice(0, LISTED);
      const more = counts[kind] - listed.length;
      return `${text} ${listed.join(", ")}${more > 0 ? ` and ${more} more` : ""}.`;
    }),
  );
}

const describeChoice = ({ reason, confidence }) =>
  Number.isFinite(confidence) ? `${reason} Probably right: ${Math.round(100 * confidence)} %.` : reason;

/**
 * List the facts about a record, with their columns as the title; the reason if no columns are chosen. They
 * are folded unless `open`.
 */
export function listFacts({ facts, choice, rows, sampling }, open = false) {
  if (!choice.output) return el("p", { class: "soft" }, choice.reason);
  const shown = facts.filter(({ name, value }) => value || !ONLY_PROBLEMS.includes(name));
  const title = `Facts about ${choice.inputs.join(", ")} and ${choice.output}`;
  return el(
    "details",
    { open },
    el("summary", {}, rows ? `${title}, samples ${rows}` : title),
    el(
      "ul",
      {},
      el("li", {}, describeChoice(choice)),
      listIrregularities(sampling ?? {}).map((sentence) => el("li", {}, sentence)),
      ...shown.map(({ sentence }) => el("li", {}, sentence)),
    ),
  );
}

/** List the facts about the record; data sets of earlier versions have none. */
const describeInspection = (inspection) => (inspection ? [listFacts(inspection)] : []);

function describeDataset(dataset, spec) {
  const { preview } = dataset;
  return [
    makeFacts([
      ["File", el("a", { href: `#/data/${dataset.id}` }, el("bdi", {}, dataset.name))],
      ["Size", formatBytes(dataset.bytes)],
      ["Samples", formatCount(preview.samples)],
      ["Sampling time", preview.dt === null ? null : `${formatShort(preview.dt)} s`],
    ]),
    ...getNotes(preview).map(makeNoteText),
    makeScrollable("Columns of the data set", makeColumnTable(dataset, spec)),
    ...describeInspection(preview.inspection),
  ];
}

/** Make the panel of a data set; `onUnitKnown(unit, columns)` receives the unit of the output. */
export function makeDatasetPanel(spec, onUnitKnown, signal) {
  const body = el("div", {}, el("p", { class: "loading" }, "Loading…"));
  poll(async () => {
    try {
      const dataset = await getJson(getDatasetPath(spec.dataset), { signal });
      body.replaceChildren(...describeDataset(dataset, spec));
      onUnitKnown(findUnit(dataset.preview.columns, spec), dataset.preview.columns);
    } catch (error) {
      if (!(error instanceof Problem) || error.status !== 404) throw error;
      body.replaceChildren(el("p", { class: "soft" }, "The data set has been deleted."));
      onUnitKnown("", []);
    }
    return Infinity;
  }, signal);
  return el("section", { class: "card" }, el("h2", {}, "Data set"), body);
}

function formatValidation({ validation: value }) {
  if (value === undefined) return "the end of the rows";
  if (typeof value === "number") return `the last ${formatShort(100 * value)} %`;
  return [`data set ${value.dataset}`, value.rows && `rows ${value.rows}`].filter(Boolean).join(", ");
}

/** Format the kind and the parameters of a simulation. */
export function formatSimulation({ kind, name, column, ...options }) {
  const parameters = Object.entries(options.parameters ?? {}).map(
    // A parameter of equations has a value, a unit and a tolerance.
    ([each, value]) => `${each} = ${formatShort(value.value ?? value)}`,
  );
  const numbers = ["order", "delay"].filter((each) => options[each]);
  const structure = numbers.map((each) => `${each} ${options[each]}`);
  return [kind, name ?? column, [...structure, ...parameters].join(", ")].filter(Boolean).join(": ");
}

/** List the settings that only a discrepancy job has. */
const listDiagnosisFacts = ({ simulation, channels = [], tolerance = {}, noise_level: noise }) => [
  ["Simulation", formatSimulation(simulation)],
  ["Channels", channels.join(", ")],
  ["Noise of the sensor", noise === undefined || noise === null ? "" : formatShort(noise)],
  ...Object.entries(tolerance).map(([name, value]) => [
    `Tolerance of ${name}`,
    `${formatShort(100 * value)} %`,
  ]),
];

/** List the settings that only an identification has. */
const listSearchFacts = (spec) => [
  (spec.model ?? "narx") === "narx" ? ["Preset", spec.preset ?? "default"] : ["Class", spec.model],
  ["Validated on", formatValidation(spec)],
];

const makeMonitorLink = (id) => el("a", { href: `#/monitors/${id}` }, id.slice(0, 8));

/** Make the panel of the settings of a job. Settings that are not given have the default of the service. */
export function makeSettingsPanel(spec) {
  const changed = Object.entries(spec.settings ?? {}).map(([name, value]) => [
    el("code", {}, name),
    Array.isArray(value) ? value.join(", ") : String(value),
  ]);
  return el(
    "section",
    { class: "card" },
    el("h2", {}, "Settings"),
    makeFacts([
      ["Monitor", spec.monitor && makeMonitorLink(spec.monitor)],
      ["Record", spec.name],
      ["Time", spec.time],
      ["Inputs", getInputs(spec).join(", ")],
      ["Output", getOutputs(spec).join(", ") || null],
      ...(spec.simulation ? listDiagnosisFacts(spec) : []),
      ...(spec.simulation || spec.monitor ? [] : listSearchFacts(spec)),
      ["Seed", spec.monitor ? null : String(spec.seed ?? "default")],
      ["Rows", spec.rows],
      ["Sampling time", spec.dt ? `${formatShort(spec.dt)} s` : null],
      ...changed,
    ]),
  );
}
