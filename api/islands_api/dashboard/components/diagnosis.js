/** Result of a discrepancy job in words and figures, or of a record of a monitor in words. */

import { getJobPath, getJson } from "../lib/api.js";
import { el } from "../lib/dom.js";
import { showProblem } from "./banner.js";
import { makeCauses } from "./diagnosing/causes.js";
import { makeNextExperiment } from "./diagnosing/next_experiment.js";
import { makeOutputsPlot } from "./diagnosing/outputs_plot.js";
import { isDiagnosis } from "./job_words.js";
import { makeEquation, makeExportRow } from "./models.js";
import { makeMonitorForm } from "./monitoring/monitor_form.js";
import { makeReportButtons, makeSaveButton } from "./report.js";

/** Return the lines of the headline, and those of the other sentences. */
function splitWords({ headline, words }) {
  const lines = words.split("\n").map((line) => line.trim());
  // Results of earlier versions have no headline.
  const first = headline?.split("\n") ?? lines;
  return [first, lines.filter((line) => !first.includes(line))];
}

/** Return the parts of a sentence; names between backticks are code. */
const splitCode = (line) => line.split("`").map((part, at) => (at % 2 ? el("code", {}, part) : part));

const makeLines = (lines) => lines.map((line) => el("p", {}, ...splitCode(line)));

/** Make the equation of an extended simulation that is one difference equation, and its exports. */
function makeExtendedEquation(job, signal) {
  const path = `${getJobPath(job.id)}/extended`;
  return el(
    "div",
    { class: "stack" },
    el("h3", {}, "Extended equation"),
    makeEquation(path, job.summary, signal),
    makeExportRow(path, "extended"),
  );
}

/** Show the figure and the causes of a diagnosis in their hosts. */
async function showResult(job, figureHost, causesHost, signal) {
  const result = await getJson(`${getJobPath(job.id)}/result`, { signal });
  figureHost.replaceChildren(...[makeOutputsPlot(job, result, signal)].filter(Boolean));
  causesHost.replaceChildren(
    ...[makeNextExperiment(job, result, signal), makeCauses(result)].filter(Boolean),
  );
}

/** Make the panels of the result: the headline and the figure, the causes, and the other sentences. */
export function makeFindingsPanels(job, signal) {
  const { summary } = job;
  const file = `extended-${job.id.slice(0, 8)}.json`;
  const [[verdict, ...headline], rest] = splitWords(summary);
  const isNamed = isDiagnosis(job) && summary.reduction_percent !== null;
  const [figureHost, causesHost] = [el("div"), el("div", { class: "stack" })];
  if (isDiagnosis(job))
    showResult(job, figureHost, causesHost, signal).catch((error) => signal.aborted || showProblem(error));
  const findings = el(
    "section",
    { class: "card findings" },
    el("h2", {}, "Findings"),
    el("p", { class: "verdict" }, ...splitCode(verdict)),
    makeLines(headline),
    figureHost,
    summary.equation && isDiagnosis(job) ? makeExtendedEquation(job, signal) : null,
    el(
      "div",
      { class: "row exports" },
      isDiagnosis(job) ? makeReportButtons(job) : null,
      isNamed ? makeSaveButton(job, "Save the extended simulation", "extended", file) : null,
    ),
    isDiagnosis(job) ? makeMonitorForm(job) : null,
  );
  const details = el("section", { class: "card sentences" }, el("h2", {}, "Details"), makeLines(rest));
  return [findings, causesHost, ...(rest.length ? [details] : [])];
}
