/** Elements, made from values and never from markup: no text of a stranger's becomes a tag. */

const SVG = "http://www.w3.org/2000/svg";

function filled(node, attributes, children) {
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

/** Make an HTML element. `on` holds listeners; an attribute that is null or false is left out. */
export const el = (name, attributes = {}, ...children) =>
  filled(document.createElement(name), attributes, children);

/** Make an SVG element. */
export const svg = (name, attributes = {}, ...children) =>
  filled(document.createElementNS(SVG, name), attributes, children);

/** Make a listener that does something once at a time. A button that was disabled would lose the focus. */
export const once = (action) => async ({ currentTarget: button }) => {
  if (button.ariaDisabled) return;
  button.ariaDisabled = "true";
  await action();
  button.ariaDisabled = null;
};

/** Set an element's text where it differs: what is selected or read out stays undisturbed otherwise. */
export function say(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Make a list of terms and what they are; entries without a value are left out. */
export const facts = (entries) =>
  el(
    "dl",
    { class: "facts" },
    entries
      .filter(([, value]) => value !== null && value !== undefined && value !== "")
      .map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))),
  );

/** Make a table. A heading is a text, or a text and a class; a row is a list of cells' contents. */
export function table(caption, headings, rows) {
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
    el("caption", { class: "unseen" }, caption),
    el("thead", {}, el("tr", {}, head)),
    el("tbody", {}, body),
  );
}

/** Let something that may be too wide be scrolled sideways, by keyboard, too. */
export const scrolled = (label, ...children) =>
  el("div", { class: "scrolled", tabindex: "0", role: "region", "aria-label": label }, children);

/** Have screen readers say something. */
export function announce(text) {
  say(document.getElementById("announcer"), text);
}
