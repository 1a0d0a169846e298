/** Table with the values and the tolerances of the parameters of a simulation. */

import { el, makeScrollable, makeTable } from "../../lib/dom.js";
import { formatShort } from "../../lib/numbers.js";

/** Return the numbers of fields that are not empty, by name. */
function readNumbers(fields, divisor) {
  const given = fields.filter(([, field]) => field.value !== "");
  return Object.fromEntries(given.map(([name, field]) => [name, Number(field.value) / divisor]));
}

/**
 * Make the table of parameters `{name, unit, default}`; null is the default of one that is estimated. Without
 * `hasValues`, the values are those of a text. `read()` returns `{parameters, tolerance}`.
 */
export function makeParameterFields(parameters, { hasValues, units: [input, output] }) {
  const [values, tolerances] = [[], []];
  const describe = (value) => (value === null ? "estimated" : formatShort(value));
  const rows = parameters.map(({ name, unit, default: value }) => {
    const field = el("input", {
      ...{ type: "number", step: "any", placeholder: describe(value), "aria-label": `Value of ${name}` },
    });
    const tolerance = el("input", {
      ...{ type: "number", step: "any", min: 0.001, max: 99, placeholder: "none" },
      "aria-label": `Tolerance of ${name} in per cent`,
    });
    if (hasValues) values.push([name, field]);
    tolerances.push([name, tolerance]);
    return [
      el("code", {}, name),
      unit.replaceAll("{input}", input || "1").replaceAll("{output}", output || "1"),
      hasValues ? field : describe(value),
      tolerance,
    ];
  });
  const headings = ["Parameter", "Unit", "Value", "Tolerance (± %)"];
  const table = makeTable("Parameters of the simulation", headings, rows);
  table.classList.add("parameters");
  return {
    node: makeScrollable("Parameters of the simulation", table),
    read: () => ({ parameters: readNumbers(values, 1), tolerance: readNumbers(tolerances, 100) }),
  };
}
