/** Equations: the MathML of the service, copied element by element so that only mathematics is inserted. */

import { getText } from "../lib/api.js";
import { el } from "../lib/dom.js";

const MATHML = "http://www.w3.org/1998/Math/MathML";

/** Allowed elements and attributes: none that could load, run or style anything. */
const ELEMENTS = new Set([
  ...["math", "mrow", "mi", "mn", "mo", "mtext", "mspace", "mfrac", "msqrt", "mroot"],
  ...["msup", "msub", "msubsup", "mover", "munder", "munderover", "mtable", "mtr", "mtd"],
]);
const ATTRIBUTES = new Set(["display", "form", "stretchy", "mathvariant", "lspace", "rspace", "width"]);

/**
 * Copy a MathML element into this document.
 * @throws {Error} if it contains an element that is not allowed
 */
function copyMath(source) {
  if (!ELEMENTS.has(source.localName)) throw new Error(`<${source.localName}> is not allowed in MathML`);
  const node = document.createElementNS(MATHML, source.localName);
  for (const { name, value } of source.attributes) if (ATTRIBUTES.has(name)) node.setAttribute(name, value);
  for (const child of source.childNodes) {
    if (child.nodeType === Node.ELEMENT_NODE) node.append(copyMath(child));
    else if (child.nodeType === Node.TEXT_NODE) node.append(child.data);
  }
  return node;
}

/**
 * Parse the equations of a model, one `math` element for each.
 * @throws {Error} if they are not MathML
 */
export function parseMath(source) {
  // Without its namespace it is plain XML, which the browser neither styles nor runs.
  const plain = source.replace(/\sxmlns="[^"]*"/g, "");
  const parsed = new DOMParser().parseFromString(`<equations>${plain}</equations>`, "application/xml");
  const equations = [...parsed.documentElement.children];
  const isMath = equations.length && equations.every((each) => each.localName === "math");
  if (!isMath || parsed.querySelector("parsererror"))
    throw new Error("the equation is not MathML");
  return equations.map(copyMath);
}

/** Make plain equations, one in each line, whose lines break between factors only. */
export const makeLine = (equation) =>
  equation.split(/(?<=\*| [+-] |= |\n)|(?=\n)/).map((part) => (part === "\n" ? part : el("span", {}, part)));

/** Load the equations of a model. */
export async function loadEquations(model, signal) {
  return parseMath(await getText(`${model}/export?format=mathml`, { signal }));
}
