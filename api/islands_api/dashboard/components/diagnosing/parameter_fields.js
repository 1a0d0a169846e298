/** Table with the values and the tolerances of the parameters of a simulation. */

import { el, makeScrollable, makeTable } from "../../lib/dom.js";
import { formatShort } from "../../lib/numbers.js";
import { getFields, limitInput } from "../../lib/schema.js";

/** Return the numbers of fields that are not empty, by name. */
function readNumbers(fields, divisor) {
  const given = fields.filter(([, field]) => field.value !== "");
  return Object.fromEntries(given.map(([name, field]) => [name, Number(field.value) / divisor]));
}

/** Set fields to given numbers, in units of `1 / factor`. */
function writeNumbers(fields, given, factor) {
  for (const [name, field] of fields)
    // Without the rounding error of the factor.
    if (given[name] !== undefined) field.value = Number((given[name] * factor).toPrecision(15));
}

/**
 * Make the table of parameters `{name, unit, default}`; null is the default of one that is estimated. Without
 * `hasValues`, the values are those of a text. With `chosen`, a check box selects the parameters that are
 * calibrated, at first these names. `read()` returns `{parameters, tolerance, chosen}`; `fill` sets the first
 * two.
 */
export function makeParameterFields(parameters, { hasValues, units: [input, output], chosen = null }) {
  const [values, tolerances, boxes] = [[], [], []];
  const describe = (value) => (value === null ? "estimated" : formatShort(value));
  const rows = parameters.map(({ name, unit, default: value }) => {
    const field = el("input", {
      ...{ type: "number", step: "any", placeholder: describe(value), "aria-label": `Value of ${name}` },
    });
    const tolerance = el("input", {
      placeholder: "none",
      "aria-label": `Tolerance of ${name} in per cent`,
    });
    if (hasValues) values.push([name, field]);
    tolerances.push([name, tolerance]);
    const label = `Calibrate ${name}`;
    const checked = chosen?.includes(name);
    if (chosen) boxes.push([name, el("input", { type: "checkbox", checked, "aria-label": label })]);
    return [
      el("code", {}, name),
      unit.replaceAll("{input}", input || "1").replaceAll("{output}", output || "1"),
      hasValues ? field : describe(value),
      tolerance,
      ...(chosen ? [boxes.at(-1)[1]] : []),
    ];
  });
  // The form states that the service does not answer.
  getFields("DiscrepancyRequest").then(({ tolerance: { additionalProperties: schema } }) => {
    for (const [, field] of tolerances) limitInput(field, schema, 100);
  }, () => {});
  const headings = ["Parameter", "Unit", "Value", "Tolerance (± %)", ...(chosen ? ["Calibrate"] : [])];
  const table = makeTable("Parameters of the simulation", headings, rows);
  table.classList.add("parameters");
  return {
    node: makeScrollable("Parameters of the simulation", table),
    fill({ parameters = {}, tolerance = {} }) {
      writeNumbers(values, parameters, 1);
      writeNumbers(tolerances, tolerance, 100);
    },
    read: () => ({
      parameters: readNumbers(values, 1),
      tolerance: readNumbers(tolerances, 100),
      chosen: boxes.filter(([, box]) => box.checked).map(([name]) => name),
    }),
  };
}
