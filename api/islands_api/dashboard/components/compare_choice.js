/** Choice of models of a job that are compared, and the link that starts its job again with changes. */

import { el } from "../lib/dom.js";
import { formatSize } from "../lib/numbers.js";

/** Models that are marked at first: the recommended one and the one of the least error. */
const isMarked = ({ rank, recommended }) => recommended || rank === 1;

/** Make the choice among the models of a job; nothing for a single one. */
export function makeCompareChoice(job, models) {
  if (models.length < 2) return null;
  const link = el("a", { class: "button" }, "Compare");
  const fields = models.map((model) => {
    const field = el("input", { type: "checkbox", value: model.rank });
    field.checked = isMarked(model);
    return field;
  });
  function update() {
    const chosen = fields.filter(({ checked }) => checked).map(({ value }) => `${job.id}:${value}`);
    if (chosen.length > 1) link.href = `#/compare?jobs=${chosen.join(",")}`;
    else link.removeAttribute("href");
    link.setAttribute("aria-disabled", String(chosen.length < 2));
  }
  update();
  return el(
    "details",
    { class: "compare" },
    el("summary", {}, "Compare models"),
    el(
      "div",
      { class: "row", on: { change: update } },
      models.map(({ rank, size, kind }, at) =>
        el("label", {}, fields[at], ` ${rank} (${formatSize(size, kind)})`),
      ),
      link,
    ),
  );
}

/** Make the link to the form of the job's data set with its settings; nothing for the record of a monitor. */
export const makeRunAgainLink = ({ id, kind, spec }) =>
  kind === "identification" || kind === "discrepancy"
    ? el("a", { class: "button", href: `#/data/${spec.dataset}?job=${id}` }, "Run again with changes")
    : null;
