/** Model of several outputs of a succeeded job: equations, errors of each output, terms and figures. */

import { getJobPath, getJson } from "../lib/api.js";
import { el, makeScrollable, makeTable } from "../lib/dom.js";
import { formatNumber } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";
import { makeLinearSystem } from "./linear_system.js";
import {
  formatR2,
  makeEquation,
  makeExportRow,
  makeGallery,
  makeSentences,
} from "./models.js";
import { makeScenarioUpload } from "./scenario_upload.js";
import { makeExactValue, makeQuantityPanel, makeTermPanel } from "./term_table.js";

/** Make the table of the errors of every output in the common free run. */
function makeOutputTable(outputs) {
  const getErrors = (output, part, mode) => output.metrics[part][mode];
  return makeTable(
    "Errors of the outputs",
    [
      "Output",
      ...["MAPE est. %", "MAPE val. %", "R² val.", "RMSE val.", "One-step RMSE val.", "90 % band ±"].map(
        (name) => [name, "figure"],
      ),
    ],
    outputs.map((output, place) => {
      const run = getErrors(output, "validation", "free_run");
      return [
        el("span", {}, `y${place + 1}: `, el("bdi", {}, output.name), output.unit ? ` (${output.unit})` : ""),
        makeExactValue(getErrors(output, "estimation", "free_run").mape, formatNumber),
        makeExactValue(run.mape, formatNumber),
        makeExactValue(run.r2, formatR2),
        makeExactValue(run.rmse, formatNumber),
        makeExactValue(getErrors(output, "validation", "one_step_ahead").rmse, formatNumber),
        makeExactValue(getHalfWidth(output.bands), formatNumber),
      ];
    }),
  );
}

/** Return the median half-width of the 90 % band; null without bands. */
function getHalfWidth(bands) {
  const at = bands?.levels.indexOf(0.9) ?? -1;
  return at < 0 ? null : bands.factors[at] * bands.width;
}

/** Make the model of several outputs: equations, errors, terms and the free run of every output. */
function makeCoupledDetail(job, { model, outputs, record }, signal) {
  const path = `${getJobPath(job.id)}/models/${model.rank}`;
  // The parameters of a large state space are coordinates, and have no meaning one by one.
  const [title, equation, content] = model.quantities
    ? ["State space", "", makeQuantityPanel(model, record.names)]
    : ["Equations", makeEquation(path, model, signal), makeTermPanel(model)];
  return [
    el("h3", { id: "model" }, title),
    equation,
    makeExportRow(path, model.rank),
    el("h4", {}, "Outputs"),
    makeScrollable("Errors of the outputs", makeOutputTable(outputs)),
    content,
    makeGallery(path, signal),
    makeLinearSystem(path, job.spec, signal),
    makeScenarioUpload(path, job.spec.output, signal),
  ];
}

/** Make the panel of the model of several outputs. */
export function makeCoupledPanel(job, signal) {
  const body = el("div", {}, el("p", { class: "loading" }, "Loading…"));
  const article = el("article", { class: "model", "aria-labelledby": "model" });
  poll(async () => {
    const path = `${getJobPath(job.id)}/result`;
    const { models: [model], outputs, record } = await getJson(path, { signal });
    article.replaceChildren(...makeCoupledDetail(job, { model, outputs, record }, signal));
    const note = el(
      "p",
      { class: "soft small" },
      "All outputs are simulated together. The validation data selected the equations, so these errors are "
        + "not an independent test.",
    );
    body.replaceChildren(makeSentences(job), note, article);
    return Infinity;
  }, signal);
  return { node: el("section", { class: "card" }, el("h2", {}, "Model"), body), select() {} };
}
