/** Says above the page what is wrong: that the service is away, and every problem that it told. */

import { connection } from "./api.js";
import { announce, el } from "./dom.js";

const shown = new Map();

/** Take a banner of a kind away. */
export function clear(kind) {
  shown.get(kind)?.remove();
  shown.delete(kind);
}

function put(kind, ...content) {
  const node = el("section", { class: `banner ${kind}` }, content);
  if (shown.get(kind)?.textContent === node.textContent) return;
  clear(kind);
  shown.set(kind, node);
  document.getElementById("banners").append(node);
}

/** Show a problem: its title, what to do, and the request's id for whoever reads the logs. */
export function complain(error, kind = "problem") {
  const click = () => clear(kind);
  const dismiss = el("button", { type: "button", class: "quiet", on: { click } }, "Dismiss");
  put(
    kind,
    el(
      "div",
      {},
      el("strong", {}, error.title ?? "Something is wrong"),
      el("p", {}, error.message),
      error.request && el("p", { class: "soft small" }, "Request ", el("code", {}, error.request)),
    ),
    dismiss,
  );
}

connection.addEventListener("away", ({ detail }) => {
  const text = "This page goes on by itself as soon as it is back; accepted jobs are kept.";
  put("away", el("div", {}, el("strong", {}, detail), el("p", {}, text)));
});

connection.addEventListener("back", () => {
  if (!shown.has("away")) return;
  clear("away");
  announce("The service is back.");
});
