/** Form for the key, shown if the service needs one. The key is kept until the tab is closed. */

import { Unavailable, key, sendRequest } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";

/** Characters that a header may contain. */
const KEY_CHARACTERS = /^[\x21-\x7e]+$/;

/** Command that creates a key, and its options. */
const COMMAND = ["islands admin keys", "--scope read", "--scope write"];

/** Show the form; call `onAccepted()` once the service accepts the key. */
export function mountKeyForm(host, problem, onAccepted) {
  const complaint = el("p", { class: "complaint", id: "complaint", role: "alert" }, problem?.message ?? "");
  const field = el("input", {
    id: "key",
    type: "password",
    autocomplete: "off",
    spellcheck: "false",
    required: true,
    "aria-describedby": "complaint",
  });
  const submit = el("button", { type: "submit", class: "strong" }, "Open");

  async function check(event) {
    event.preventDefault();
    const secret = field.value.trim();
    if (!KEY_CHARACTERS.test(secret)) {
      setText(complaint, "A key has letters, digits, hyphens and underscores, and no spaces.");
      return;
    }
    submit.disabled = true;
    key.set(secret);
    try {
      await sendRequest("v1/jobs?limit=1");
      onAccepted();
    } catch (error) {
      // Forget a key that the service rejects, also one that only lacks the scope `read`.
      if (!(error instanceof Unavailable)) key.forget();
      setText(complaint, error.message);
      submit.disabled = false;
      field.select();
    }
  }

  host.replaceChildren(
    el(
      "form",
      { class: "key card", on: { submit: check } },
      el("h1", { tabindex: "-1" }, "This service needs a key"),
      el(
        "p",
        { class: "soft" },
        "Its operator creates one with ",
        // Lines break between the options only.
        el("code", {}, COMMAND.flatMap((part, at) => [at ? " " : "", el("span", {}, part)])),
        ". The key is kept until this tab is closed.",
      ),
      el("label", { for: "key" }, "Key"),
      el("div", { class: "row" }, field, submit),
      complaint,
    ),
  );
  field.focus();
}
