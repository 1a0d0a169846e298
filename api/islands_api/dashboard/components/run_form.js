/** Form that starts an identification of a data set, with the same request for other programs. */

import { postJson } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";
import { clearBanner, showProblem } from "./banner.js";

/** Presets of a job, with their purpose. */
const PRESETS = {
  auto: "auto: tries models of hysteresis, friction and smooth systems on the record, and chooses",
  narx: "narx: polynomial and sign terms without constraints",
  hysteresis: "hysteresis: the output rests where the input rests",
};

const makeField = (label, field, hint) => {
  field.id = `run-${field.name}`;
  field.setAttribute("aria-describedby", `${field.id}-hint`);
  return [
    el("label", { for: field.id }, label),
    field,
    el("span", { class: "soft small", id: `${field.id}-hint` }, hint),
  ];
};

const quote = (text) => (/^[\w.,:/+-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);

/** Return the commands that submit a request. */
function describeRequest(request, name) {
  const url = location.href.replace(/[?#].*$/, "").replace(/\/$/, "");
  const { inputs, output, rows, validation, preset } = request;
  const options = [
    ...inputs.flatMap((each) => ["--input", quote(each)]),
    ...["--output", quote(output)],
    ...(rows ? ["--rows", rows] : []),
    ...(validation === undefined ? [] : ["--validation", String(validation)]),
    ...(preset === "auto" ? [] : ["--preset", preset]),
  ];
  return {
    "Command line": `islands jobs submit ${quote(name)} ${options.join(" ")} \\\n  --url ${url} --watch`,
    Python: [
      "from islands_api import Client",
      "",
      // A request has no value that Python writes otherwise.
      `job = Client(${JSON.stringify(url)}).submit(**${JSON.stringify(request)})`,
    ].join("\n"),
    curl: [
      `curl ${url}/v1/jobs -H 'Content-Type: application/json' \\`,
      `  -d ${quote(JSON.stringify(request))}`,
    ].join("\n"),
  };
}

/** Make the form of a data set; `show({inputs, output})` and `setRows([start, stop])` update it. */
export function makeRunForm({ id, name, preview }) {
  const submit = el("button", { type: "submit", class: "strong" }, "Identify");
  const chosen = el("p");
  const preset = el(
    "select",
    { name: "preset" },
    Object.entries(PRESETS).map(([value, text]) => el("option", { value }, text)),
  );
  const rows = el("input", { name: "rows", placeholder: "all", pattern: "\\d*:\\d*", maxlength: 40 });
  const fraction = el("input", {
    ...{ name: "validation", type: "number", min: 1, max: 90, step: 1, placeholder: 25 },
  });
  const commands = el("div");
  let [choice, visible] = [{ inputs: [], output: "" }, null];

  const makeRequest = () => ({
    dataset: id,
    inputs: choice.inputs,
    output: choice.output,
    preset: preset.value,
    name,
    ...(rows.value && { rows: rows.value }),
    ...(fraction.value && { validation: Number(fraction.value) / 100 }),
  });

  function update() {
    const isComplete = choice.inputs.length > 0 && choice.output !== "";
    submit.disabled = !isComplete;
    const text = `${choice.inputs.join(", ")} → ${choice.output}`;
    setText(chosen, isComplete ? text : "Choose at least one input and the output in the table of columns.");
    const blocks = Object.entries(isComplete ? describeRequest(makeRequest(), name) : {}).flatMap(
      ([title, command]) => [el("h3", {}, title), el("pre", { tabindex: "0" }, el("code", {}, command))],
    );
    commands.replaceChildren(...blocks);
  }

  async function run(event) {
    event.preventDefault();
    clearBanner("problem");
    submit.disabled = true;
    try {
      const job = await postJson("v1/jobs", makeRequest());
      location.hash = `#/jobs/${job.id}`;
    } catch (error) {
      showProblem(error);
      submit.disabled = false;
    }
  }

  function takeVisible() {
    rows.value = visible === null ? "" : visible.join(":");
    update();
  }

  const take = el("button", { type: "button", on: { click: takeVisible } }, "Use the visible rows");
  const form = el(
    "form",
    { class: "run", on: { submit: run, input: update } },
    el("div", { class: "row" }, submit, chosen),
    el(
      "details",
      {},
      el("summary", {}, "Settings"),
      el(
        "div",
        { class: "fields" },
        makeField("Preset", preset, "What the search tries. The job states its choice and the reason."),
        makeField("Rows", rows, "START:STOP of the rows that are used, counted from 0; all by default."),
        el("span"),
        take,
        el("span"),
        makeField("Validation", fraction, `Per cent of the rows at the end that select the model.`),
      ),
    ),
    el("details", {}, el("summary", {}, "The same as a command"), commands),
  );
  update();
  return {
    node: el("section", { class: "card" }, el("h2", {}, "Identify"), form),
    show(newChoice) {
      choice = newChoice;
      update();
    },
    setRows([start, stop]) {
      visible = start === 0 && stop === preview.samples ? null : [start, stop];
    },
  };
}
