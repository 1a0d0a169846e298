/** Table of a list of the service, in pages: rows are updated in place, since one may have the focus. */

import { el } from "../lib/dom.js";

/**
 * Make a table.
 *
 * A heading is a text, or a text and a class. `makeRow(item)` returns `{node, show(item)}`;
 * `makeEmptyMessage()` the text of a page without items; `makeAddress(cursor)` the address of a page.
 * `show({items, next})` updates the table and the links to other pages.
 */
export function makePagedTable({ caption, headings, makeRow, makeEmptyMessage, makeAddress, cursor }) {
  const heads = headings.map((heading) => [heading].flat());
  const body = el("tbody");
  const table = el(
    "table",
    { class: "listing" },
    el("caption", { class: "visually-hidden" }, caption),
    el("thead", {}, el("tr", {}, heads.map(([name, kind]) => el("th", { scope: "col", class: kind }, name)))),
    body,
  );
  const list = el("div", {}, el("p", { class: "loading" }, "Loading…"));
  const pages = el("nav", { class: "pages", "aria-label": "Pages" });
  const rows = new Map();
  let isEmpty = null;

  function updateRows(items) {
    const wanted = new Set(items.map((item) => item.id));
    for (const [id, { node }] of rows) {
      if (!wanted.has(id)) {
        node.remove();
        rows.delete(id);
      }
    }
    items.forEach((item, at) => {
      if (rows.has(item.id)) rows.get(item.id).show(item);
      else rows.set(item.id, makeRow(item));
      const { node } = rows.get(item.id);
      if (body.children[at] !== node) body.insertBefore(node, body.children[at] ?? null);
    });
  }

  function updatePages(next) {
    const links = [cursor && ["← Newest", makeAddress("")], next && ["Older →", makeAddress(next)]];
    const wanted = links.filter(Boolean);
    if (wanted.map(String).join() !== [...pages.children].map((a) => [a.textContent, a.hash]).join())
      pages.replaceChildren(...wanted.map(([name, href]) => el("a", { class: "button", href }, name)));
  }

  return {
    nodes: [list, pages],
    show({ items, next }) {
      updateRows(items);
      if (isEmpty !== (items.length === 0)) {
        isEmpty = items.length === 0;
        list.replaceChildren(isEmpty ? makeEmptyMessage() : table);
      }
      updatePages(next);
    },
  };
}
