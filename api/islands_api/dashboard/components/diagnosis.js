/** Result in words of a discrepancy job, with its report, or of a record of a monitor. */

import { el } from "../lib/dom.js";
import { makeMonitorForm } from "./monitoring/monitor_form.js";
import { makeReportButtons, makeSaveButton } from "./report.js";

/** Return whether a job is a discrepancy diagnosis. */
export const isDiagnosis = (job) => job.kind === "discrepancy";

/** Return whether a job identifies models. */
export const isSearch = (job) => job.kind === "identification";

/** Format the verdict of a job, `named: thermal-drift`, or the status of its monitor. */
export const formatVerdict = ({ verdict: word, effects = [], status }) =>
  effects.length ? `${word}: ${effects.join(", ")}` : (word ?? status);

/** Make the panel of the result. */
export function makeFindingsPanel(job) {
  const { summary } = job;
  const file = `extended-${job.id.slice(0, 8)}.json`;
  const [first, ...lines] = summary.words.split("\n");
  const isNamed = isDiagnosis(job) && summary.reduction_percent !== null;
  return el(
    "section",
    { class: "card findings" },
    el("h2", {}, "Findings"),
    el("p", { class: "verdict" }, first),
    lines.map((line) => el("p", {}, line.trim())),
    el(
      "div",
      { class: "row exports" },
      isDiagnosis(job) ? makeReportButtons(job) : null,
      isNamed ? makeSaveButton(job, "Save the extended simulation", "extended", file) : null,
    ),
    isDiagnosis(job) ? makeMonitorForm(job) : null,
  );
}
