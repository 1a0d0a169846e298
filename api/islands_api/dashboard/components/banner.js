/** Banners above the page: problems, and a notice while the service is unavailable. */

import { connection } from "../lib/api.js";
import { announce, el } from "../lib/dom.js";

const banners = new Map();

/** Remove the banner of a kind. */
export function clearBanner(kind) {
  banners.get(kind)?.remove();
  banners.delete(kind);
}

function showBanner(kind, ...content) {
  const node = el("section", { class: `banner ${kind}` }, content);
  if (banners.get(kind)?.textContent === node.textContent) return;
  clearBanner(kind);
  banners.set(kind, node);
  document.getElementById("banners").append(node);
}

/** Show what the page does for some seconds. */
export const showNotice = (text) => showBanner("notice", el("p", { role: "status" }, text));

/** Show a problem: its title, what to do, and the id of the request for a search in the logs. */
export function showProblem(error, kind = "problem") {
  const click = () => clearBanner(kind);
  const dismiss = el("button", { type: "button", class: "quiet", on: { click } }, "Dismiss");
  showBanner(
    kind,
    el(
      "div",
      {},
      el("strong", {}, error.title ?? "Something is wrong"),
      el("p", {}, error.message),
      error.requestId && el("p", { class: "soft small" }, "Request ", el("code", {}, error.requestId)),
    ),
    dismiss,
  );
}

connection.addEventListener("unavailable", ({ detail }) => {
  const text = "This page reconnects automatically. Accepted jobs are kept.";
  showBanner("unavailable", el("div", {}, el("strong", {}, detail), el("p", {}, text)));
});

connection.addEventListener("available", () => {
  if (!banners.has("unavailable")) return;
  clearBanner("unavailable");
  announce("The service is available again.");
});
