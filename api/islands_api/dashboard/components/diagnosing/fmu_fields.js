/** Choice of an FMU as simulation: a file, its input and output, and the calibrated parameters. */

import { getJson } from "../../lib/api.js";
import { el, setText } from "../../lib/dom.js";
import { makeField } from "../job_request.js";
import { makeParameterFields } from "./parameter_fields.js";

const FORM = "diagnose";

const makeOptions = (variables) =>
  variables.map(({ name, unit }) => el("option", { value: name }, unit ? `${name} in ${unit}` : name));

const makeChoice = (name, variables) => el("select", { name }, makeOptions(variables));

/** Upload an FMU; return its description. */
function uploadFmu(file) {
  const body = new FormData();
  body.append("file", file);
  return getJson("v1/fmus", { method: "POST", body });
}

/** Return whether a channel has a name, with or without a unit behind it: `w`, `w_N` or `w [N]`. */
const hasName = (channel, name) =>
  channel.name === name ||
  (channel.unit !== "" &&
    channel.name.startsWith(name) &&
    /^(_[^_]+|\s*[[(（,/].+)$/.test(channel.name.slice(name.length)));

/**
 * Make the fields of further inputs, which are driven by channels `{name, unit}` of the same name; `driven`
 * are the names of those of a request, or null.
 */
function makeChannelFields(inputs, channels, driven) {
  const fields = inputs.map(({ name }, place) => {
    const found = channels.find((each) => hasName(each, name));
    const options = found ? [el("option", { value: name }, found.name)] : [];
    options.push(el("option", { value: "" }, "nothing"));
    const field = el("select", { name: `fmu-channel-${place}` }, options);
    if (driven && !driven.includes(name)) field.value = "";
    const hint = found
      ? "Without a channel it keeps its start value."
      : `It keeps its start value. To drive it, choose a column with the name ${name} as a further input.`;
    return { field, nodes: makeField(FORM, `${name} is driven by`, field, hint) };
  });
  return {
    nodes: fields.flatMap(({ nodes }) => nodes),
    read: () => fields.map(({ field }) => field.value).filter(Boolean),
  };
}

/** Quote a value of an option behind the name of an FMU. */
const quoteOption = (text) => text.replace(/[%&+]/g, encodeURIComponent);

/**
 * Make the fields of the variables of an FMU; `given` has the simulation and the tolerance of a request, or
 * is null. `read()` returns its simulation and the tolerances. `setChannels(channels)` states which channels
 * `{name, unit}` can drive further inputs.
 */
function makeVariableFields(fmu, given, onChange) {
  const [input, output] = [makeChoice("fmu-input", fmu.inputs), makeChoice("fmu-output", fmu.outputs)];
  const isShort = fmu.parameters.length <= fmu.most_parameters;
  const described = fmu.parameters.map(({ name, unit, start }) => ({ name, unit, default: start }));
  const named = Object.entries(given?.simulation.parameters ?? {});
  const calibrated = given ? named.filter(([, { fixed }]) => !fixed) : described.map(({ name }) => [name]);
  const chosen = given || isShort ? calibrated.map(([name]) => name) : [];
  const fields = makeParameterFields(described, { hasValues: true, units: ["", ""], chosen });
  if (given) {
    [input.value, output.value] = [given.simulation.input, given.simulation.output];
    const parameters = Object.fromEntries(named.map(([name, { value }]) => [name, value]));
    fields.fill({ parameters, tolerance: given.tolerance });
  }
  const initial = fmu.initial.map(({ name }) => name).join(", ") || "none";
  const further = el("div", { class: "fields" });
  let [channels, channelFields] = [[], null];

  function showChannels() {
    const others = fmu.inputs.filter(({ name }) => name !== input.value);
    channelFields = makeChannelFields(others, channels, given && (given.simulation.channels ?? []));
    further.replaceChildren(...channelFields.nodes);
  }

  function setChannels(found) {
    if (JSON.stringify(found) === JSON.stringify(channels)) return;
    channels = found;
    showChannels();
    onChange();
  }

  input.addEventListener("change", showChannels);
  showChannels();
  const node = el(
    "div",
    {},
    el(
      "div",
      { class: "fields" },
      makeField(FORM, "Input of the FMU", input, "It is driven by the input of the record."),
      makeField(FORM, "Output of the FMU", output, "It is compared with the measured output."),
    ),
    further,
    described.length > 0 && fields.node,
    el("p", { class: "soft small" }, `Calibrated at the first sample: ${initial}.`),
  );

  /** Return the parameters that are calibrated, and those with another value, which is exact. */
  function readParameters({ parameters: values, chosen: free }) {
    const isListed = ({ name }) => name in values || free.includes(name);
    const listed = described.filter(isListed).map(({ name }) => name);
    const entries = listed.map((name) => {
      const value = name in values ? { value: values[name] } : {};
      return [name, free.includes(name) ? value : { ...value, fixed: true }];
    });
    return Object.fromEntries(entries);
  }

  function read() {
    const found = fields.read();
    const driven = channelFields.read();
    const names = { input: input.value, output: output.value, ...(driven.length && { channels: driven }) };
    const parameters = readParameters(found);
    const simulation = { kind: "fmu", file: fmu.id, ...names, parameters };
    const listed = Object.entries(parameters).map(([name, { value }]) =>
      value === undefined ? name : `${name}=${value}`,
    );
    const options = Object.entries({ ...names, parameters: listed }).map(
      ([name, value]) => `${name}=${quoteOption(String(value))}`,
    );
    // The command line has neither exact values nor names with its separators: they are in a file.
    const isFixed = Object.values(parameters).some(({ fixed }) => fixed);
    const hasSeparators = [...driven, ...Object.keys(parameters)].some((name) => /[,=]/.test(name));
    const isInFile = isFixed || hasSeparators || fmu.name.includes("?");
    const argument = isInFile ? "fmu.toml" : `${fmu.name}?${options.join("&")}`;
    const tolerance = Object.entries(found.tolerance).filter(([name]) => found.chosen.includes(name));
    const request = { simulation, tolerance: Object.fromEntries(tolerance), argument };
    if (!isInFile) return request;
    const lines = writeFile(fmu.name, names, parameters);
    return { ...request, before: ["cat > fmu.toml <<'END'", ...lines, "END"] };
  }
  return { node, setChannels, read };
}

/** Return the lines of a TOML file of an FMU. */
function writeFile(file, names, parameters) {
  const entries = Object.entries(parameters).map(([name, each]) => {
    const fields = Object.entries(each).map(([key, value]) => `${key} = ${value}`);
    return `${JSON.stringify(name)} = { ${fields.join(", ")} }`;
  });
  const first = Object.entries({ file, ...names }).map(([key, name]) => `${key} = ${JSON.stringify(name)}`);
  return [...first, "", "[parameters]", ...entries];
}

/**
 * Make the choice of an FMU. `read()` returns the simulation, its tolerances and the parts of its command, or
 * null. `onChange()` is called at every change; `setChannels(channels)` states the channels `{name, unit}` of
 * the record, and `fill(request)` loads the FMU of a request.
 */
export function makeFmuFields(onChange, signal) {
  const complaint = el("p", { class: "complaint" });
  const file = el("input", { name: "fmu", type: "file", accept: ".fmu" });
  const stored = el("select", { name: "stored-fmu" });
  const storedFields = el(
    "div",
    { class: "fields", hidden: true },
    makeField(FORM, "Uploaded FMU", stored, "One that was uploaded before."),
  );
  const message = el("p", { class: "check", role: "status" });
  const host = el("div");
  let [variables, channels, asked] = [null, [], ""];

  function show(fmu, words = "", given = null) {
    variables = fmu && makeVariableFields(fmu, given, onChange);
    variables?.setChannels(channels);
    host.replaceChildren(...(fmu ? [variables.node] : []));
    message.classList.toggle("complaint", fmu === null && words !== "");
    setText(message, words);
    onChange();
  }

  async function take(request, words, given = null) {
    show(null);
    setText(message, words);
    try {
      const fmu = await request();
      show(fmu, `FMI ${fmu.fmi}, ${fmu.interface}: ${fmu.parameters.length} parameters.`, given);
      return fmu;
    } catch (error) {
      if (!signal.aborted) show(null, error.message);
      return null;
    }
  }

  async function list(chosen = "") {
    const { items } = await getJson("v1/fmus?limit=200", { signal });
    const options = items.map(({ id, name }) => el("option", { value: id }, name));
    stored.replaceChildren(el("option", { value: "" }, "–"), ...options);
    stored.value = chosen;
    storedFields.hidden = !items.length;
  }

  const listSafely = (chosen) =>
    list(chosen).catch((error) => signal.aborted || setText(message, error.message));
  const load = (id) => getJson(`v1/fmus/${encodeURIComponent(id)}`, { signal });
  file.addEventListener("change", async () => {
    if (!file.files.length) return;
    const fmu = await take(() => uploadFmu(file.files[0]), `Reading ${file.files[0].name}…`);
    if (fmu) listSafely(fmu.id);
  });
  const takeStored = () => take(() => load(stored.value), "Loading…");
  stored.addEventListener("change", () => (stored.value ? takeStored() : show(null)));
  const hint = "FMI 2.0 or 3.0. The service runs its code in a process that can read nothing else.";
  const fields = el("div", { class: "fields" }, makeField(FORM, "File", file, hint));
  const node = el("div", { class: "fmu" }, fields, storedFields, message, host);
  return {
    node,
    open: () => listSafely(stored.value || asked),
    fill({ simulation, tolerance = {} }) {
      asked = simulation.file;
      take(() => load(asked), "Loading…", { simulation, tolerance });
    },
    setChannels(found) {
      channels = found;
      variables?.setChannels(channels);
    },
    read: () => variables && variables.read(),
  };
}
