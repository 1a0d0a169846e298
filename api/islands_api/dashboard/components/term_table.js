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

/** Columns of quantities: heading, name of the field and digits. */
const QUANTITY_COLUMNS = [["Value", "value", 6], ["Standard error", "standard_error", 2]];

/** Make the table of the modes and gains of a linear system, whose parameters are coordinates of its states. */
export function makeQuantityPanel({ quantities }, { inputs, outputs }) {
  const describe = ({ name, unit, input, output }) => {
    const where = input === null ? "" : ` of ${inputs[input - 1]} on ${outputs[output - 1]}`;
    return `${name}${where}${unit ? ` (${unit})` : ""}`;
  };
  const table = makeTable(
    "Modes and gains of the model",
    ["Quantity", ...QUANTITY_COLUMNS.map(([heading]) => [heading, "figure"])],
    quantities.map((each) => [
      describe(each),
      ...QUANTITY_COLUMNS.map(([, field, digits]) =>
        makeExactValue(each[field], (number) => formatNumber(number, digits))),
    ]),
  );
  return el("div", {}, el("h4", {}, "Modes and gains"), makeScrollable("Modes and gains", table));
}
