/** Simulation of a model on files of its inputs: planned experiments, or records with measured outputs. */

import { postJson, saveBlob } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";
import { formatShort, labelQuantity } from "../lib/numbers.js";
import { makeLineChart } from "./chart.js";
import { uploadFile } from "./file_upload.js";

/** Write columns as a table for other programs, with every digit. */
export function writeTable(headings, columns) {
  const quote = (text) => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const rows = columns[0].map((_, row) => columns.map((column) => column[row] ?? ""));
  return [headings.map(quote), ...rows].map((row) => `${row.join(",")}\n`).join("");
}

/** Make the button that saves the simulation of a file. */
function makeSaveButton(name, { time_s: times, outputs }) {
  const save = () => {
    const table = writeTable(["t_s", ...Object.keys(outputs)], [times, ...Object.values(outputs)]);
    saveBlob(new Blob([table], { type: "text/csv" }), `${name.replace(/\.[^.]*$/, "")}-simulated.csv`);
  };
  return el("button", { type: "button", on: { click: save } }, `Save ${name} simulated`);
}

/** Make a chart of every output with a line for each file. */
function makeCharts(names, runs, signal) {
  const time = { label: "time (s)", describe: (at) => `${formatShort(Number(at.toPrecision(6)))} s` };
  return Object.keys(runs[0].outputs).map((output) => {
    const label = labelQuantity(output, runs[0].units[output]);
    const chart = makeLineChart({ title: `Simulated ${output}`, x: time, y: { label } }, signal);
    chart.draw(runs.map((run, at) => ({ name: names[at], x: run.time_s, y: run.outputs[output] })));
    return chart.node;
  });
}

/** Make the form that simulates files with the model at a path, whose outputs it starts from if given. */
export function makeScenarioUpload(path, outputs, signal) {
  const field = el("input", { type: "file", multiple: true, required: true });
  const kind = { type: "number", step: "any", placeholder: "at rest" };
  const starts = outputs.map((name) => el("input", { ...kind, name }));
  const status = el("p", { class: "small", role: "status" });
  const results = el("div", { class: "linear" });

  async function simulate(event) {
    event.preventDefault();
    const files = [...field.files];
    const given = starts.filter(({ value }) => value !== "").map((each) => [each.name, each.valueAsNumber]);
    status.classList.remove("complaint");
    setText(status, "Simulating…");
    try {
      const datasets = [];
      for (const file of files) datasets.push({ dataset: (await uploadFile(file)).id });
      const request = { datasets, start: Object.fromEntries(given) };
      const { items: runs } = await postJson(`${path}/scenarios`, request, { signal });
      const names = files.map(({ name }) => name);
      setText(status, runs.map((run, at) => `${names[at]}: ${run.start}, ${run.outcome}.`).join(" "));
      const listed = runs.flatMap((run, at) => run.warnings.map((text) => `${names[at]}: ${text}`));
      results.replaceChildren(
        el("ul", { class: "warnings" }, listed.map((text) => el("li", {}, text))),
        ...makeCharts(names, runs, signal),
        el("div", { class: "row exports" }, runs.map((run, at) => makeSaveButton(names[at], run))),
      );
    } catch (error) {
      if (signal.aborted) return;
      status.classList.add("complaint");
      setText(status, error.message);
    }
  }

  return el(
    "div",
    { class: "scenarios", role: "group", "aria-label": "Simulate files of inputs" },
    el("h4", {}, "Simulate files of inputs"),
    el(
      "form",
      { class: "row point", on: { submit: simulate } },
      el("label", { class: "level" }, "Files", field),
      starts.map((each) => el("label", { class: "level" }, `${each.name} before the first sample`, each)),
      el("button", { type: "submit" }, "Simulate"),
    ),
    status,
    results,
  );
}
