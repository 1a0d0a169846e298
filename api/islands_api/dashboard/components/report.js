/** Buttons for the report of a succeeded job. */

import { download, getJobPath, key } from "../lib/api.js";
import { el, runOnceAtATime } from "../lib/dom.js";
import { showProblem } from "./banner.js";

/** Make a button that saves a resource of a job. */
export function makeSaveButton(job, text, resource, name) {
  const path = `${getJobPath(job.id)}/${resource}`;
  const save = runOnceAtATime(() => download(path, name).catch(showProblem));
  return el("button", { type: "button", "data-resource": resource, on: { click: save } }, text);
}

/** Make the buttons that open and save the report of a job. */
export function makeReportButtons(job) {
  const href = `${getJobPath(job.id)}/report`;
  return [
    // A link cannot send the key.
    key.get() ? null : el("a", { class: "button", href, target: "_blank" }, "Read the report"),
    makeSaveButton(job, "Save the report", "report", `report-${job.id.slice(0, 8)}.html`),
  ];
}
