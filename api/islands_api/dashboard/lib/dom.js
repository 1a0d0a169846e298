/** DOM elements, made from values and never from markup, so that untrusted text cannot become a tag. */

const SVG = "http://www.w3.org/2000/svg";

function fill(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "on") {
      for (const [event, listener] of Object.entries(value)) node.addEventListener(event, listener);
    } else if (value !== null && value !== undefined && value !== false) {
      node.setAttribute(name, value === true ? "" : value);
    }
  }
  node.append(...children.flat().filter((child) => ![null, undefined, false, ""].includes(child)));
  return node;
}

/** Make an HTML element. `on` has the listeners; attributes that are null or false are omitted. */
export const el = (name, attributes = {}, ...children) =>
  fill(document.createElement(name), attributes, children);

/** Make an SVG element. */
export const svg = (name, attributes = {}, ...children) =>
  fill(document.createElementNS(SVG, name), attributes, children);

/** Make a listener that ignores clicks while its action runs. A disabled button would lose the focus. */
export const runOnceAtATime = (action) => async ({ currentTarget: button }) => {
  if (button.ariaDisabled) return;
  button.ariaDisabled = "true";
  await action();
  button.ariaDisabled = null;
};

/** Set the text of an element only if it differs, which preserves selections and screen reader output. */
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Make a description list; entries without a value are omitted. */
export const makeFacts = (entries) =>
  el(
    "dl",
    { class: "facts" },
    entries
      .filter(([, value]) => value !== null && value !== undefined && value !== "")
      .map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))),
  );

/** Make a table. A heading is a text, or a text and a class; a row is a list of cell contents. */
export function makeTable(caption, headings, rows) {
  const classes = headings.map((heading) => (Array.isArray(heading) ? heading[1] : null));
  const names = headings.map((heading) => (Array.isArray(heading) ? heading[0] : heading));
  const body = rows.map((cells) =>
    el(
      "tr",
      {},
      cells.map((cell, at) =>
        at === 0
          ? el("th", { scope: "row", class: classes[at] }, cell)
          : el("td", { class: classes[at], "data-label": names[at] }, cell),
      ),
    ),
  );
  const head = names.map((name, at) => el("th", { scope: "col", class: classes[at] }, name));
  return el(
    "table",
    {},
    el("caption", { class: "visually-hidden" }, caption),
    el("thead", {}, el("tr", {}, head)),
    el("tbody", {}, body),
  );
}

/** Make a container that scrolls sideways, also with the keyboard. */
export const makeScrollable = (label, ...children) =>
  el("div", { class: "scrolled", tabindex: "0", role: "region", "aria-label": label }, children);

/** Announce a text to screen readers. */
export function announce(text) {
  setText(document.getElementById("announcer"), text);
}
