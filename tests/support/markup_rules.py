"""Rules of WCAG 2.2 A and AA about the markup of a page: names, roles, ids, structure, sizes of targets."""

from typing import Any

#: Script that returns every defect of the visible markup. The names of rules are those of axe-core.
_SCRIPT = """() => {
  const found = [];
  const all = (selector) => [...document.querySelectorAll(selector)].filter((node) => node.checkVisibility());
  const show = (node) => node.outerHTML.slice(0, 90);
  const check = (rule, selector, isRight) => {
    for (const node of all(selector)) if (!isRight(node)) found.push(`${rule}: ${show(node)}`);
  };
  const text = (node) => (node.textContent ?? "").trim();
  const byIds = (node, name) => (node.getAttribute(name) ?? "").split(/\\s+/).filter(Boolean);
  const hasName = (node) => Boolean(node.ariaLabel || node.title || text(node) || node.labels?.length
    || byIds(node, "aria-labelledby").some((id) => text(document.getElementById(id) ?? node)));
  const roles = new Set(["alert", "group", "img", "math", "region", "slider", "status", "list", "listitem",
    "note", "search", "table", "row", "presentation", "none", "dialog", "toolbar", "button", "link"]);
  const values = {
    pressed: ["true", "false", "mixed"], expanded: ["true", "false"], hidden: ["true", "false"],
    disabled: ["true", "false"], invalid: ["true", "false", "grammar", "spelling"],
    current: ["page", "step", "location", "date", "time", "true", "false"],
    live: ["off", "polite", "assertive"],
    sort: ["ascending", "descending", "none", "other"], busy: ["true", "false"],
    checked: ["true", "false", "mixed"], selected: ["true", "false"], atomic: ["true", "false"],
  };
  const known = new Set([...Object.keys(values), "label", "labelledby", "describedby", "description",
    "controls", "valuemin", "valuemax", "valuenow", "valuetext", "details", "roledescription",
    "errormessage", "haspopup",
    "modal", "owns", "colindex", "rowindex", "colcount", "rowcount", "keyshortcuts", "relevant"]);

  const ids = [...document.querySelectorAll("[id]")].map((node) => node.id);
  for (const id of new Set(ids.filter((id, at) => ids.indexOf(id) !== at))) found.push(`duplicate-id: ${id}`);
  for (const name of ["aria-labelledby", "aria-describedby", "aria-controls", "aria-details", "for"])
    check("aria-valid-attr-value", `[${name}]`,
      (node) => byIds(node, name).every((id) => document.getElementById(id)));
  check("aria-roles", "[role]", (node) => roles.has(node.getAttribute("role")));
  for (const node of all("*"))
    for (const { name, value } of node.attributes) {
      if (!name.startsWith("aria-")) continue;
      const key = name.slice(5);
      if (!known.has(key)) found.push(`aria-valid-attr: ${show(node)}`);
      else if (!(values[key] ?? [value]).includes(value)) found.push(`aria-valid-attr-value: ${show(node)}`);
    }
  check("aria-required-attr", "[role=slider]", (node) => ["min", "max", "now"].every((each) =>
    Number.isFinite(Number.parseFloat(node.getAttribute(`aria-value${each}`)))));
  const named = ["img", "region", "slider", "group"].map((each) => `[role=${each}]`);
  check("a role without a name", `${named}, dialog[open], summary`, hasName);
  check("label", "input, select, textarea", (node) => node.labels?.length || node.ariaLabel
    || byIds(node, "aria-labelledby").length);
  check("link-name, button-name", "a, button", hasName);
  check("label-content-name-mismatch", "button[aria-label], a[aria-label]", (node) =>
    !/[a-z]{3}/i.test(text(node)) || node.ariaLabel.toLowerCase().includes(text(node).toLowerCase()));
  check("tabindex", "[tabindex]", (node) => node.tabIndex <= 0);
  const controls = "a[href], button, input, select, textarea, summary, [tabindex='0']";
  check("aria-hidden-focus", "[aria-hidden=true]", (node) => !node.querySelector(controls));
  check("nested-interactive", "button, a[href], summary, [role=slider], [role=img]",
    (node) => !node.querySelector(controls));
  check("scrollable-region-focusable", "body *", (node) => {
    const { overflowX, overflowY } = getComputedStyle(node);
    const scrolls = (/auto|scroll/.test(overflowX) && node.scrollWidth > node.clientWidth + 1)
      || (/auto|scroll/.test(overflowY) && node.scrollHeight > node.clientHeight + 1);
    return !scrolls || node.tabIndex >= 0 || node.querySelector(controls);
  });
  check("list", "ul, ol", (node) => [...node.children].every((each) => each.matches("li, script, template")));
  check("listitem", "li", (node) => node.parentElement.matches("ul, ol, menu"));
  check("definition-list", "dl", (node) => [...node.children].every((each) => each.matches("div, dt, dd")));
  check("empty-heading", "h1, h2, h3, h4", (node) => text(node));
  check("empty-table-header", "th", (node) => text(node) || node.ariaLabel || node.querySelector("input"));
  check("scope-attr-valid", "th", (node) => ["col", "row", "colgroup", "rowgroup"].includes(node.scope));
  check("td-has-header", "tbody td", (node) => node.closest("table").querySelector("th"));
  check("svg-img-alt", "svg", (node) => node.ariaHidden === "true" || node.closest("[aria-hidden=true]")
    || node.ariaLabel || node.querySelector("title"));
  check("canvas without a text", "canvas", (node) => node.closest("[aria-label]"));

  // Landmarks: https://www.w3.org/WAI/ARIA/apg/practices/landmark-regions/
  if (all("main").length !== 1) found.push("landmark-one-main");
  const navs = all("nav");
  if (navs.length > 1 && new Set(navs.map((node) => node.ariaLabel)).size < navs.length)
    found.push("landmark-unique: nav");
  check("region", "body > *", (node) => node.matches(
    "header, main, nav, footer, aside, dialog, .skip, [role], [aria-live], script") || !text(node));
  if (!document.title.trim()) found.push("document-title");
  const viewport = document.querySelector("meta[name=viewport]")?.content ?? "";
  if (/user-scalable\\s*=\\s*no|maximum-scale/.test(viewport)) found.push("meta-viewport");

  // Target size (2.5.8): 24 pixels, or a circle of that diameter that touches no other target.
  const isInline = (node) => getComputedStyle(node).display === "inline" && node.matches("a")
    && text(node) !== text(node.parentElement);
  const targets = all("a[href], button, input, select, textarea, summary").filter((node) => !isInline(node)
    && !node.closest(".skip"));
  const boxes = targets.map((node) => (node.closest("label") ?? node).getBoundingClientRect());
  const centre = (box) => [(box.left + box.right) / 2, (box.top + box.bottom) / 2];
  targets.forEach((node, at) => {
    const box = boxes[at];
    if (Math.min(box.width, box.height) >= 24 || !box.width) return;
    const [x, y] = centre(box);
    const touches = boxes.some((other, place) => {
      if (place === at || !other.width || targets[place].closest("label") === (node.closest("label") ?? 0))
        return false;
      const isSmall = Math.min(other.width, other.height) < 24;
      const [ox, oy] = centre(other);
      if (isSmall && Math.hypot(ox - x, oy - y) < 24) return true;
      const dx = Math.max(other.left - x, 0, x - other.right);
      const dy = Math.max(other.top - y, 0, y - other.bottom);
      return Math.hypot(dx, dy) < 12;
    });
    const size = [box.width, box.height].map(Math.round).join(" x ");
    if (touches) found.push(`target-size: ${size}: ${show(node)}`);
  });
  return [...new Set(found)];
}"""


def find_markup_defects(page: Any) -> list[str]:
    """Return the visible markup of a page that breaks a rule, with the name of the rule."""
    defects: list[str] = page.evaluate(_SCRIPT)
    return defects
