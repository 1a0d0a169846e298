/** Equations: the service's MathML, copied element by element, so that nothing but mathematics comes in. */

import { text } from "./api.js";

const MATHML = "http://www.w3.org/1998/Math/MathML";

/** What an equation is made of. Attributes that could load, run or style something are not among them. */
const ELEMENTS = new Set([
  ...["math", "mrow", "mi", "mn", "mo", "mtext", "mspace", "mfrac", "msqrt", "mroot"],
  ...["msup", "msub", "msubsup", "mover", "munder", "munderover", "mtable", "mtr", "mtd"],
]);
const ATTRIBUTES = new Set(["display", "form", "stretchy", "mathvariant", "lspace", "rspace", "width"]);

/**
 * Copy an element of mathematics into this document.
 * @throws {Error} it holds something else
 */
function copied(source) {
  if (!ELEMENTS.has(source.localName)) throw new Error(`<${source.localName}> is no mathematics`);
  const node = document.createElementNS(MATHML, source.localName);
  for (const { name, value } of source.attributes) if (ATTRIBUTES.has(name)) node.setAttribute(name, value);
  for (const child of source.childNodes) {
    if (child.nodeType === Node.ELEMENT_NODE) node.append(copied(child));
    else if (child.nodeType === Node.TEXT_NODE) node.append(child.data);
  }
  return node;
}

/**
 * Read an equation.
 * @throws {Error} it is no MathML
 */
export function mathOf(source) {
  // Without its namespace it is plain XML, of which the browser neither styles nor runs anything.
  const plain = source.replace(/\sxmlns="[^"]*"/, "");
  const read = new DOMParser().parseFromString(plain, "application/xml");
  if (read.querySelector("parsererror") || read.documentElement.localName !== "math")
    throw new Error("the equation is no MathML");
  return copied(read.documentElement);
}

/** Ask for a model's equation. */
export async function equationOf(model, signal) {
  return mathOf(await text(`${model}/export?format=mathml`, { signal }));
}
