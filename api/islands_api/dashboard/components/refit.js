/** Models whose parameters were estimated again on all data, after their errors were measured. */

import { el } from "../lib/dom.js";

/** Make a paragraph that names these models; none without one. An entry has a model and its name. */
export function listRefits(entries, head = "") {
  const names = entries.filter(({ model: { refit } }) => refit && !refit.discarded).map(({ name }) => name);
  const rest = "the parameters were estimated again on all data after the errors were measured.";
  return names.length ? [el("p", { class: "soft small" }, `${head}${names.join(", ")}: ${rest}`)] : [];
}
