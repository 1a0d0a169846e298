/** Asks for a key when the service wants one. It is kept until the tab is closed, in no address. */

import { Away, ask, key } from "./api.js";
import { el, say } from "./dom.js";

/** Characters that may be sent in a header. */
const SENDABLE = /^[\x21-\x7e]+$/;

/** Show the question; `done()` once the service takes the key. */
export function askForKey(host, problem, done) {
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
    if (!SENDABLE.test(secret)) {
      say(complaint, "A key has letters, digits and underscores, and no spaces.");
      return;
    }
    submit.disabled = true;
    key.set(secret);
    try {
      await ask("v1/jobs?limit=1");
      done();
    } catch (error) {
      // A key without the scope `read` is a key; the problem says what it lacks.
      if (!(error instanceof Away)) key.forget();
      say(complaint, error.message);
      submit.disabled = false;
      field.select();
    }
  }

  host.replaceChildren(
    el(
      "form",
      { class: "key card", on: { submit: check } },
      el("h1", { tabindex: "-1" }, "This service asks for a key"),
      el(
        "p",
        { class: "soft" },
        "Whoever runs it makes one with ",
        el("code", {}, "islands keys create --scope read --scope write"),
        ". It is kept until this tab is closed.",
      ),
      el("label", { for: "key" }, "Key"),
      el("div", { class: "row" }, field, submit),
      complaint,
    ),
  );
  field.focus();
}
