/** Table of a list of the service, in pages: rows are updated in place, since one may have the focus. */

import { el } from "../lib/dom.js";

const makeHeading = ([content, kind, order]) =>
  el("th", { scope: "col", class: kind, "aria-sort": order }, content);

/**
 * Make a table.
 *
 * A heading is a text, or a content, a class and an order, `ascending` or `descending`. `makeRow(item)`
 * returns `{node, show(item)}`; `makeEmptyMessage()` the text of a page without items; `makeAddress(cursor)`
 * the address of a page. `show({items, next})` updates the table and the links to other pages.
 *
 * While `isHeld(table)` is true, rows are updated but none is added, removed or moved: the user is about to
 * click one. A button shows the new ones. `release()` lets the next update change the rows.
 */
export function makePagedTable(options) {
  const { caption, headings, makeRow, makeEmptyMessage, makeAddress, cursor, isHeld } = options;
  const heads = headings.map((heading) => [heading].flat());
  const body = el("tbody");
  const table = el(
    "table",
    { class: "listing" },
    el("caption", { class: "visually-hidden" }, caption),
    el("thead", {}, el("tr", {}, heads.map(makeHeading))),
    body,
  );
  const list = el("div", {}, el("p", { class: "loading" }, "Loading…"));
  const pages = el("nav", { class: "pages", "aria-label": "Pages" });
  const news = el("div", { class: "news", role: "status" });
  const rows = new Map();
  let [isEmpty, isReleased] = [null, false];

  /** Return whether the rows are kept, since they would move under the hands of the user. */
  function keepRows(page) {
    const { items } = page;
    const isSame = items.length === rows.size && items.every((item) => rows.has(item.id));
    const isKept = !isSame && !isReleased && rows.size > 0 && Boolean(isHeld?.(table));
    isReleased = false;
    const added = items.filter((item) => !rows.has(item.id)).length;
    const click = () => {
      isReleased = true;
      show(page);
    };
    const text = added ? `Show ${added} new` : null;
    if (!isKept || !text) news.replaceChildren();
    else if (news.textContent !== text)
      news.replaceChildren(el("button", { type: "button", on: { click } }, text));
    return isKept;
  }

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

  function show(page) {
    const { items, next } = page;
    if (keepRows(page)) {
      for (const item of items) rows.get(item.id)?.show(item);
      return;
    }
    updateRows(items);
    if (isEmpty !== (items.length === 0)) {
      isEmpty = items.length === 0;
      list.replaceChildren(isEmpty ? makeEmptyMessage() : table);
    }
    updatePages(next);
  }

  return {
    nodes: [news, list, pages],
    show,
    release: () => {
      isReleased = true;
    },
  };
}
