/** Choice of the simulation of a diagnosis: its kind, and the fields of that kind. */

import { getJson } from "../../lib/api.js";
import { el, setText } from "../../lib/dom.js";
import { getServiceUrl, makeField, quote } from "../job_request.js";
import { makeEquationsEditor } from "./equations_editor.js";
import { makeFmuFields } from "./fmu_fields.js";
import { makeParameterFields } from "./parameter_fields.js";

const FORM = "diagnose";

const LABELS = {
  column: "A column of the file",
  ode: "Differential equations as text",
  linear: "A linear model",
  model: "An identified model of a job",
  fmu: "An FMU",
};

const makeSelect = (name, options) =>
  el("select", { name }, options.map(([value, text]) => el("option", { value }, text)));

function makeColumnFields(columns) {
  const column = makeSelect("column", columns.map((name) => [name, name]));
  const hint = columns.length
    ? "The recorded output of the simulation."
    : "The file has no column besides the chosen ones.";
  return {
    node: el("div", { class: "fields" }, makeField(FORM, "Column", column, hint)),
    fill({ simulation }) {
      if (columns.includes(simulation.column)) column.value = simulation.column;
    },
    read: () =>
      column.value && { simulation: { kind: "column", column: column.value }, argument: column.value },
  };
}

function makePhysicalFields({ kind, parameters }, units) {
  const fields = makeParameterFields(parameters, { hasValues: true, units });
  const file = `${kind}.json`;
  return {
    node: fields.node,
    fill: ({ simulation, tolerance }) => fields.fill({ ...simulation, tolerance }),
    read() {
      const { parameters: given, tolerance } = fields.read();
      if (!Object.keys(given).length) return { simulation: { kind }, tolerance };
      const before = [`echo ${quote(JSON.stringify(given))} > ${file}`];
      return { simulation: { kind, parameters: given }, tolerance, argument: file, before };
    },
  };
}

function makeLinearFields() {
  let given = {};
  const makeNumber = (name, value, max) => el("input", { name, type: "number", min: 0, max, step: 1, value });
  const [order, delay] = [makeNumber("order", 2, 10), makeNumber("delay", 0, 1000)];
  return {
    node: el(
      "div",
      { class: "fields" },
      makeField(FORM, "Order", order, "Number of poles, and of zeros. All coefficients are estimated."),
      makeField(FORM, "Delay", delay, "Samples by which the input acts late."),
    ),
    fill({ simulation }) {
      given = simulation;
      [order.value, delay.value] = [simulation.order, simulation.delay ?? 0];
    },
    read: () =>
      order.value !== "" && {
        simulation: { ...given, kind: "linear", order: Number(order.value), delay: Number(delay.value) },
        argument: `${order.value}:${delay.value || 0}`,
      },
  };
}

/** Make the choice of an identified model, from the newest jobs. */
function makeModelFields(onChange, signal) {
  const jobs = makeSelect("model", []);
  const fields = makeField(FORM, "Job", jobs, "Its recommended model is simulated.");
  const node = el("div", { class: "fields" }, fields);
  const message = el("p", { class: "soft", role: "status" }, "Loading…");
  node.append(el("span"), message);
  let [path, model, given] = ["", null, null];

  async function load() {
    [path, model] = [jobs.value, jobs.value ? null : given];
    onChange();
    if (!path) return;
    const found = await getJson(`${path}/export?format=json`, { signal });
    if (path !== jobs.value) return;
    model = found;
    onChange();
  }

  const loadSafely = () => load().catch((error) => signal.aborted || setText(message, error.message));
  async function open() {
    const { items } = await getJson("v1/jobs?state=succeeded&limit=200", { signal });
    const found = items.filter(({ kind, summary }) => kind === "identification" && summary?.rank);
    const options = found.map(({ id, name, summary }) => {
      const text = `${name || id.slice(0, 8)}: ${summary.equation}`;
      return el("option", { value: `v1/jobs/${id}/models/${summary.rank}` }, text);
    });
    if (given) options.unshift(el("option", { value: "" }, "The model of that diagnosis"));
    jobs.replaceChildren(...options);
    setText(message, options.length ? "" : "No job has identified a model of one output yet.");
    await load();
  }
  jobs.addEventListener("change", loadSafely);
  return {
    node,
    open: () => open().catch((error) => signal.aborted || setText(message, error.message)),
    fill({ simulation }) {
      given = simulation;
    },
    read() {
      if (model && model === given) return { simulation: given, argument: null };
      return model && {
        simulation: { kind: "model", model, name: "model.json" },
        argument: "model.json",
        before: [`curl '${getServiceUrl()}/${path}/export?format=json' -o model.json`],
      };
    },
  };
}

/** Make the fields of a simulation of a request that the form cannot change. */
function makeKeptFields() {
  let given = null;
  return {
    node: el("p", { class: "soft" }, "The simulation of that diagnosis, unchanged."),
    fill({ simulation }) {
      given = simulation;
    },
    read: () => ({ simulation: given, argument: null }),
  };
}

/** Return the listed simulations by kind, with that of a request. */
function listKinds(simulations, given) {
  const byKind = new Map(simulations.map((each) => [each.kind, each]));
  if (given && !byKind.has(given.kind))
    byKind.set(given.kind, { kind: given.kind, summary: "Not listed", parameters: [], estimated: "" });
  return byKind;
}

/**
 * Make the choice from the listed simulations; `initial` has the simulation and the tolerance of a request.
 *
 * `setRecord({columns, units, channels})` states the columns that may be a recorded simulation, the units of
 * input and output, and the channels `{name, unit}`. `read()` returns the simulation, the tolerance and the
 * parts of its command, or a false value if the choice is incomplete; `onChange()` is called at every change.
 */
export function makeSimulationChoice(simulations, initial, onChange, signal) {
  const byKind = listKinds(simulations, initial.simulation);
  // A recorded simulation is drawn over the measured output before anything runs.
  const kinds = [...byKind.keys()].sort((a, b) => (b === "column") - (a === "column"));
  const kind = makeSelect("simulation", kinds.map((each) => [each, LABELS[each] ?? each]));
  const chosen = initial.simulation?.kind;
  if (chosen) kind.value = chosen;
  let record = { columns: [], units: ["", ""], channels: [] };
  const templates = simulations.filter(({ equations }) => equations);
  const makers = {
    column: () => makeColumnFields(record.columns),
    linear: makeLinearFields,
    ode: () => makeEquationsEditor(templates, onChange, signal),
    model: () => makeModelFields(onChange, signal),
    fmu: () => makeFmuFields(onChange, signal),
  };
  const made = new Map();
  const host = el("div");
  const summary = el("p", { class: "soft small" });

  function getFields() {
    const listed = byKind.get(kind.value);
    const isKept = !simulations.includes(listed);
    const make = makers[kind.value] ?? (() => makePhysicalFields(listed, record.units));
    if (!made.has(kind.value)) {
      made.set(kind.value, isKept ? makeKeptFields() : make());
      if (kind.value === chosen) made.get(kind.value).fill(initial);
      made.get(kind.value).setChannels?.(record.channels);
    }
    return made.get(kind.value);
  }

  function show() {
    const { summary: words, estimated } = byKind.get(kind.value);
    // The reference sets names of files in backquotes.
    const text = `${words}.${estimated && ` Estimated unless given: ${estimated}.`}`;
    setText(summary, text.replaceAll("`", ""));
    const fields = getFields();
    if (fields.node !== host.firstChild) host.replaceChildren(fields.node);
    fields.open?.();
    onChange();
  }

  /** Return the simulation; fields without tolerances keep those of the request. */
  function read() {
    const found = getFields().read();
    return found && kind.value === chosen ? { tolerance: initial.tolerance, ...found } : found;
  }

  /** Replace only the fields that depend on the change: a text or values may have been entered. */
  function setRecord(newRecord) {
    const hasChanged = (part) => String(record[part]) !== String(newRecord[part]);
    const [columns, units] = [hasChanged("columns"), hasChanged("units")];
    record = newRecord;
    // A linear model suits any record; the built-in simulations are of a certain system.
    if (!made.size && !chosen && !record.columns.length) kind.value = "linear";
    for (const each of kinds)
      if ((each === "column" && columns) || (byKind.get(each).parameters.length && units)) made.delete(each);
    for (const each of made.values()) each.setChannels?.(record.channels);
    if (!made.has(kind.value)) show();
  }

  kind.addEventListener("change", show);
  const hint = "For a simulation in Python or another program, add its output to the file as a column.";
  const node = el(
    "div",
    { class: "simulation" },
    el("div", { class: "fields" }, makeField(FORM, "Simulation", kind, hint)),
    summary,
    host,
  );
  return { node, setRecord, read };
}
