/** Fields of forms from the JSON schemas that the service publishes: their bounds, choices and defaults. */

import { getJson } from "./api.js";
import { el } from "./dom.js";

let published = null;

/** Return the schemas of the fields of a request, by name. */
export async function getFields(request) {
  published ??= getJson("openapi.json");
  try {
    return (await published).components.schemas[request].properties;
  } catch (error) {
    published = null;
    throw error;
  }
}

/** Return the type of a field that is not null. */
export const findType = ({ anyOf = [], ...schema }) => anyOf.find(({ type }) => type !== "null") ?? schema;

export const isNumber = ({ type }) => type === "integer" || type === "number";

/** Keep the number of an input within the bounds of its schema, in units of `1 / factor`. */
export function limitInput(input, schema, factor = 1) {
  const { type, minimum, maximum, exclusiveMinimum, exclusiveMaximum } = findType(schema);
  const [min, max] = [minimum ?? exclusiveMinimum, maximum ?? exclusiveMaximum];
  input.type = "number";
  input.step = type === "integer" ? 1 : "any";
  if (min !== undefined) input.min = min * factor;
  if (max !== undefined) input.max = max * factor;
}

/** Make the field of a value: a choice with an empty entry, or an input within the bounds of its schema. */
export function makeInput(schema, attributes) {
  const type = findType(schema);
  const choices = type.type === "boolean" ? ["yes", "no"] : type.enum;
  if (choices) {
    const values = [...new Set(["", ...choices])];
    return el("select", attributes, values.map((value) => el("option", { value }, value)));
  }
  const maxlength = type.maxLength ?? 500;
  const input = el("input", { maxlength, autocomplete: "off", value: schema.default, ...attributes });
  if (isNumber(type)) limitInput(input, schema);
  return input;
}
