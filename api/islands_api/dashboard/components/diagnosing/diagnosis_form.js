/** Form that starts a diagnosis of a simulation on a data set. */

import { getJson } from "../../lib/api.js";
import { el, setText } from "../../lib/dom.js";
import { getFields, limitInput } from "../../lib/schema.js";
import { makeField, makeJobForm, quote } from "../job_request.js";
import { makeSimulationChoice } from "./simulation_choice.js";
import { makeSimulationPreview } from "./simulation_preview.js";

const ABSENT = "Choose the input of the simulation and the measured output in the table of columns.";

/** Return the form of a request for other programs. */
function describe({ input, output, channels = [], rows, noise_level, tolerance = {} }, simulated) {
  const { simulation, argument, before } = simulated;
  // No file has the simulation of an earlier job.
  if (argument === null) return { call: "diagnose", command: "diagnose" };
  const options = [
    ...["--input", quote(input), "--output", quote(output)],
    ...channels.flatMap((each) => ["--channel", quote(each)]),
    ...["--simulation", quote([simulation.kind, argument].filter(Boolean).join(":"))],
    ...Object.entries(tolerance).flatMap(([name, value]) => ["--tolerance", quote(`${name}=${value}`)]),
    ...(noise_level ? ["--noise-level", `${noise_level}`] : []),
    ...(rows ? ["--rows", rows] : []),
  ];
  return { call: "diagnose", command: "diagnose", options, before };
}

/** Make the field of the rows of a diagnosis, and the button that takes those of a plot. */
function makeRowsField(samples, initial, getVisibleRows, onChange) {
  const rows = el("input", { name: "rows", placeholder: "all", pattern: "-?\\d*:-?\\d*", maxlength: 40 });
  rows.value = initial ?? "";
  function takeVisible() {
    const [start, stop] = getVisibleRows();
    rows.value = start === 0 && stop === samples ? "" : `${start}:${stop}`;
    onChange();
  }
  const take = el("button", { type: "button", on: { click: takeVisible } }, "Use the visible rows");
  const hint = "START:STOP of the rows that are used, counted from 0; all by default.";
  return {
    nodes: [...makeField("diagnose", "Rows", rows, hint), el("span"), take, el("span")],
    get: () => rows.value,
  };
}

/** Make the field of the noise of the sensor. */
function makeNoiseField(initial) {
  const level = el("input", { name: "noise_level", placeholder: "unknown", value: initial });
  const nodes = makeField("diagnose", "Noise of the sensor", level, "");
  function describe(schema) {
    limitInput(level, schema);
    setText(nodes.at(-1), schema.description);
  }
  return { nodes, describe, get: () => Number(level.value) };
}

/** Return the fields of a request that the form keeps as they are, and their description in words. */
function keepFields({ dt, recordings = [], validation, seed }) {
  const kept = { ...(dt && { dt }), ...(recordings.length && { recordings }) };
  const words = [
    dt && `a sampling time of ${dt} s`,
    recordings.length && `${recordings.length} further recordings`,
    validation && `the recording ${validation.dataset.slice(0, 8)} for validation`,
    seed && `the seed ${seed}`,
  ].filter(Boolean);
  return [
    { ...kept, ...(validation && { validation }), ...(seed && { seed }) },
    words.length > 0 && el("p", { class: "soft small" }, `Kept from that diagnosis: ${words.join(", ")}.`),
  ];
}

/**
 * Make the form of a data set; `initial` is the request of a job, or empty. `show({inputs, output})` updates
 * it. `getVisibleRows()` returns the rows of the plot; `onSimulation` is called with the column of a recorded
 * simulation, or null.
 */
export function makeDiagnosisForm({ id, name, preview }, initial, getVisibleRows, onSimulation, signal) {
  const usable = preview.columns.filter((column) => column.name !== preview.time && !column.problem);
  const units = Object.fromEntries(usable.map((column) => [column.name, column.unit]));
  const driver = el("select", { name: "input" });
  const driverField = el(
    "div",
    { class: "fields", hidden: true },
    makeField("diagnose", "Driven by", driver, "The other inputs are channels, such as a temperature."),
  );
  const rows = makeRowsField(preview.samples, initial.rows, getVisibleRows, update);
  const noise = makeNoiseField(initial.noise_level);
  const [kept, keptWords] = keepFields(initial);
  const host = el("div", {}, el("p", { class: "loading" }, "Loading…"));
  const isAgain = Boolean(initial.simulation);
  let [choice, simulated, column] = [{ inputs: [], output: "" }, null, null];

  function makeRequest() {
    const { inputs, output } = choice;
    const found = simulated?.read();
    if (!inputs.length || output === "" || typeof output !== "string" || !found) return null;
    const channels = inputs.filter((each) => each !== driver.value);
    const { simulation, tolerance = {} } = found;
    return {
      dataset: id,
      input: driver.value,
      output,
      ...(channels.length && { channels }),
      simulation,
      ...(Object.keys(tolerance).length && { tolerance }),
      name: initial.name ?? name,
      ...(rows.get() && { rows: rows.get() }),
      ...(noise.get() > 0 && { noise_level: noise.get() }),
      ...kept,
    };
  }

  function explain(request) {
    if (!choice.inputs.length || typeof choice.output !== "string" || choice.output === "") return ABSENT;
    if (request === null) return "Complete the simulation.";
    return `${request.output} against the simulation of ${request.input}`;
  }

  function update() {
    form.update();
    calibrated.update();
    const { column: found = null } = (details.open && makeRequest()?.simulation) || {};
    if (found === column) return;
    column = found;
    onSimulation(column);
  }

  function setRecord() {
    const taken = [...choice.inputs, choice.output];
    const columns = usable.map((each) => each.name).filter((each) => !taken.includes(each));
    const channels = choice.inputs
      .filter((each) => each !== driver.value)
      .map((each) => ({ name: each, unit: units[each] ?? "" }));
    simulated?.setRecord({ columns, units: [units[driver.value], units[choice.output]], channels });
    update();
  }

  async function open() {
    if (!form.node.isConnected) details.append(form.node);
    try {
      if (simulated === null) {
        noise.describe((await getFields("DiscrepancyRequest")).noise_level);
        const { items } = await getJson("v1/simulations", { signal });
        const accepted = items.filter(({ refusal }) => !refusal);
        simulated = makeSimulationChoice(accepted, initial, update, signal);
        host.replaceChildren(simulated.node);
      }
    } catch (error) {
      if (!signal.aborted) host.replaceChildren(el("p", { class: "complaint" }, error.message));
    }
    setRecord();
  }

  const calibrated = makeSimulationPreview(makeRequest, signal);
  const form = makeJobForm({
    action: "Diagnose",
    path: "v1/discrepancies",
    makeRequest,
    describe: (request) => describe(request, simulated.read()),
    explain,
    fields: (row) => [
      driverField,
      host,
      keptWords,
      el(
        "details",
        { open: Boolean(initial.rows || initial.noise_level) },
        el("summary", {}, "Rows and noise"),
        el("div", { class: "fields" }, rows.nodes, noise.nodes),
      ),
      row,
      calibrated.node,
    ].filter(Boolean),
  });
  form.node.addEventListener("input", update);
  driver.addEventListener("change", setRecord);
  const title = el("summary", {}, el("h2", {}, "Diagnose a simulation"));
  const purpose = "What does a simulation of this output lack? Its error is split into named causes.";
  const details = el("details", { class: "card", open: isAgain }, title, el("p", { class: "soft" }, purpose));
  details.addEventListener("toggle", open);
  return {
    node: details,
    show(newChoice) {
      choice = newChoice;
      const chosen = driver.value || initial.input;
      driver.replaceChildren(...choice.inputs.map((each) => el("option", { value: each }, each)));
      if (choice.inputs.includes(chosen)) driver.value = chosen;
      driverField.hidden = choice.inputs.length < 2;
      setRecord();
    },
  };
}
