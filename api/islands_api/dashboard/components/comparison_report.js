/** Buttons for the report of a comparison. */

import { download, key } from "../lib/api.js";
import { el, runOnceAtATime } from "../lib/dom.js";
import { showProblem } from "./banner.js";

/** Make the buttons that open and save the report of the compared models, as `{job, model}`. */
export function makeComparisonReportButtons(entries) {
  const models = entries.map(({ job, model }) => ["model", `${job.id}:${model.rank}`]);
  const path = `v1/comparisons/report?${new URLSearchParams(models)}`;
  const save = runOnceAtATime(() => download(path, "comparison.html").catch(showProblem));
  return el(
    "div",
    { class: "row exports" },
    // A link cannot send the key.
    key.get() ? null : el("a", { class: "button", href: path, target: "_blank" }, "Read the report"),
    el("button", { type: "button", on: { click: save } }, "Save the report"),
  );
}
