/** Confirmation dialog for actions that cannot be undone. */

import { el } from "../lib/dom.js";

/** Ask for confirmation; resolve to true if confirmed. Escape cancels. */
export function askConfirmation(title, text, action, refusal = "Keep it") {
  return new Promise((resolve) => {
    const close = (value) => ({ click: () => dialog.close(value) });
    const dialog = el(
      "dialog",
      { "aria-labelledby": "question" },
      el("h2", { id: "question" }, title),
      el("p", {}, text),
      el(
        "div",
        { class: "row end" },
        el("button", { type: "button", autofocus: true, on: close("no") }, refusal),
        el("button", { type: "button", class: "danger", on: close("yes") }, action),
      ),
    );
    dialog.addEventListener("close", () => {
      dialog.remove();
      resolve(dialog.returnValue === "yes");
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}
