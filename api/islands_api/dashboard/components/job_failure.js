/** Failure of a job: the reason, what to do, and whether a resumed job can succeed. */

import { el } from "../lib/dom.js";

/** Failures that the same job meets again, with what helps. */
const REMEDIES = {
  "invalid-record": "Correct the record, or read it with other options, and start a new job.",
  "invalid-settings": "Start a new job with other settings.",
  "invalid-model": "Start a new job with a corrected model or expression.",
  "no-such-monitor": "Create the monitor again, and add the record to it.",
  "job-failed": "Start a new job with other data or settings.",
  defect: "Start it again after the next update of the service.",
};

/** Return whether a resumed job can succeed: not after a failure that follows from its data or a defect. */
export const canResume = ({ state, problem }) =>
  state === "cancelled" || (state === "failed" && !(problem?.type in REMEDIES));

/** Make the card of a failed job; null for others. */
export function makeFailureCard(job) {
  if (job.state !== "failed" || !job.problem) return null;
  const { title, detail, type } = job.problem;
  const remedy = REMEDIES[type];
  const dataset = job.spec.dataset;
  return el(
    "section",
    { class: "card failure" },
    el("h2", {}, title ?? "The job failed"),
    el("p", {}, detail ?? ""),
    remedy && el("p", { class: "remedy" }, `The same job would fail again. ${remedy}`),
    remedy && dataset && el("p", {}, el("a", { href: `#/data/${dataset}` }, "Open the data set")),
  );
}
