/** What a discrepancy job found: its verdict in words, its report, and the mended simulation. */

import { download, key } from "./api.js";
import { complain } from "./banner.js";
import { el, once } from "./dom.js";

/** Whether a job holds a simulation against a record. */
export const diagnoses = (job) => job.kind === "discrepancy";

/** Say in short what a job found: `named: thermal-drift`. */
export const verdict = ({ verdict: said, effects }) =>
  effects.length ? `${said}: ${effects.join(", ")}` : said;

/** Show what a job found. */
export function findingsPanel(job) {
  const path = `v1/jobs/${encodeURIComponent(job.id)}`;
  const save = (what, name) => once(() => download(`${path}/${what}`, name).catch(complain));
  const button = (text, what, name) =>
    el("button", { type: "button", "data-take": what, on: { click: save(what, name) } }, text);
  const { summary } = job;
  const page = { class: "button", href: `${path}/report`, target: "_blank" };
  const [first, ...lines] = summary.words.split("\n");
  return el(
    "section",
    { class: "card findings" },
    el("h2", {}, "Findings"),
    el("p", { class: "verdict" }, first),
    lines.map((line) => el("p", {}, line.trim())),
    el(
      "div",
      { class: "row take" },
      // A link cannot send the key.
      key.get() ? null : el("a", page, "Read the report"),
      button("Save the report", "report", `report-${job.id.slice(0, 8)}.html`),
      summary.reduction_percent === null
        ? null
        : button("Save the mended simulation", "extended", `extended-${job.id.slice(0, 8)}.json`),
    ),
  );
}
