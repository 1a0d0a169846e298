/** Result of a discrepancy job: the verdict in words, the report, and the extended simulation. */

import { download, key } from "../lib/api.js";
import { el, runOnceAtATime } from "../lib/dom.js";
import { showProblem } from "./banner.js";

/** Return whether a job is a discrepancy diagnosis. */
export const isDiagnosis = (job) => job.kind === "discrepancy";

/** Format the verdict of a job: `named: thermal-drift`. */
export const formatVerdict = ({ verdict: word, effects }) =>
  effects.length ? `${word}: ${effects.join(", ")}` : word;

/** Make the panel of the result. */
export function makeFindingsPanel(job) {
  const path = `v1/jobs/${encodeURIComponent(job.id)}`;
  const save = (resource, name) =>
    runOnceAtATime(() => download(`${path}/${resource}`, name).catch(showProblem));
  const button = (text, resource, name) =>
    el("button", { type: "button", "data-resource": resource, on: { click: save(resource, name) } }, text);
  const { summary } = job;
  const reportLink = { class: "button", href: `${path}/report`, target: "_blank" };
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
      // A link cannot send the key.
      key.get() ? null : el("a", reportLink, "Read the report"),
      button("Save the report", "report", `report-${job.id.slice(0, 8)}.html`),
      summary.reduction_percent === null
        ? null
        : button("Save the extended simulation", "extended", `extended-${job.id.slice(0, 8)}.json`),
    ),
  );
}
