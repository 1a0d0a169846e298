/** Result of a discrepancy job: the verdict in words, the report, and the extended simulation. */

import { el } from "../lib/dom.js";
import { makeReportButtons, makeSaveButton } from "./report.js";

/** Return whether a job is a discrepancy diagnosis. */
export const isDiagnosis = (job) => job.kind === "discrepancy";

/** Format the verdict of a job: `named: thermal-drift`. */
export const formatVerdict = ({ verdict: word, effects }) =>
  effects.length ? `${word}: ${effects.join(", ")}` : word;

/** Make the panel of the result. */
export function makeFindingsPanel(job) {
  const { summary } = job;
  const file = `extended-${job.id.slice(0, 8)}.json`;
  const [first, ...lines] = summary.words.split("\n");
  return el(
    "section",
    { class: "card findings" },
    el("h2", {}, "Findings"),
    el("p", { class: "verdict" }, first),
    lines.map((line) => el("p", {}, line.trim())),
    el(
      "div",
      { class: "row exports" },
      makeReportButtons(job),
      summary.reduction_percent === null
        ? null
        : makeSaveButton(job, "Save the extended simulation", "extended", file),
    ),
  );
}
