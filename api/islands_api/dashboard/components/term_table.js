/** Terms of a model with their parameters, or its parameters if they have names. */

import { el, makeScrollable, makeTable } from "../lib/dom.js";
import { NONE, formatNumber, nameSize } from "../lib/numbers.js";

/** Columns of numbers: heading, name of the field and format. */
const COLUMNS = [
  ["Standard error", "standard_error", formatNumber],
  ["Inclusion", "inclusion", formatNumber],
];

/** Make an element with a formatted number; its value and title have the full precision. */
export function makeExactValue(value, format) {
  if (typeof value !== "number") return NONE;
  return el("data", { value: String(value), title: String(value) }, format(value));
}

/** Make the table of a model; columns without any number are left out. */
function makeTermTable({ kind, terms }) {
  const columns = COLUMNS.filter(([, field]) => terms.some((term) => typeof term[field] === "number"));
  const [text, value] = kind ? ["Parameter", "Value"] : ["Term", "Parameter"];
  return makeTable(
    `${nameSize(kind)} of the model`,
    [text, [value, "figure"], ...columns.map(([heading]) => [heading, "figure"])],
    terms.map((term) => [
      // Lines break between factors only. Results of earlier versions have no texts with names of columns.
      el("code", {}, (term.term ?? term.regressor).split(/(?<=\*)/).map((factor) => el("span", {}, factor))),
      makeExactValue(term.parameter, (number) => formatNumber(number, 6)),
      ...columns.map(([, field, format]) => makeExactValue(term[field], format)),
    ]),
  );
}

/** Make the table of a model with its heading. */
export function makeTermPanel(model) {
  const name = nameSize(model.kind);
  return el("div", {}, el("h4", {}, name), makeScrollable(name, makeTermTable(model)));
}
