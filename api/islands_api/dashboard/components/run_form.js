/** Form that starts an identification of a data set, with the same request for other programs. */

import { el } from "../lib/dom.js";
import { makeField, makeJobForm, makeRowsField, quote } from "./job_request.js";

/** Presets of a job, with their purpose. */
const PRESETS = {
  auto: "auto: tries models of hysteresis, friction and smooth systems on the record, and chooses",
  narx: "narx: polynomial and sign terms without constraints",
  hysteresis: "hysteresis: the output rests where the input rests",
};

const ABSENT = "Choose at least one input and the output in the table of columns.";

/** Return the form of a request for other programs. */
function describe({ inputs, output, rows, validation, preset }) {
  const options = [
    ...inputs.flatMap((each) => ["--input", quote(each)]),
    ...["--output", quote(output)],
    ...(rows ? ["--rows", rows] : []),
    ...(validation === undefined ? [] : ["--validation", String(validation)]),
    ...(preset === "auto" ? [] : ["--preset", preset]),
  ];
  return { call: "submit", command: "submit", options };
}

/** Make the form of a data set; `show({inputs, output})` and `setRows([start, stop])` update it. */
export function makeRunForm({ id, name, preview }) {
  const preset = el(
    "select",
    { name: "preset" },
    Object.entries(PRESETS).map(([value, text]) => el("option", { value }, text)),
  );
  const fraction = el("input", {
    ...{ name: "validation", type: "number", min: 1, max: 90, step: 1, placeholder: 25 },
  });
  const rows = makeRowsField("run", preview.samples, () => form.update());
  let choice = { inputs: [], output: "" };

  function makeRequest() {
    if (!choice.inputs.length || choice.output === "") return null;
    return {
      dataset: id,
      inputs: choice.inputs,
      output: choice.output,
      preset: preset.value,
      name,
      ...(rows.get() && { rows: rows.get() }),
      ...(fraction.value && { validation: Number(fraction.value) / 100 }),
    };
  }

  const settings = el(
    "div",
    { class: "fields" },
    makeField("run", "Preset", preset, "What the search tries. The job states its choice and the reason."),
    rows.nodes,
    makeField("run", "Validation", fraction, "Per cent of the rows at the end that select the model."),
  );
  const form = makeJobForm({
    action: "Identify",
    path: "v1/jobs",
    makeRequest,
    describe,
    explain: (request) => (request ? `${request.inputs.join(", ")} → ${request.output}` : ABSENT),
    fields: (row) => [row, el("details", {}, el("summary", {}, "Settings"), settings)],
  });
  form.update();
  return {
    node: el("section", { class: "card" }, el("h2", {}, "Identify"), form.node),
    show(newChoice) {
      choice = newChoice;
      form.update();
    },
    setRows: rows.setVisible,
  };
}
