/** Form that creates a monitor of the simulation of a diagnosis. */

import { postJson } from "../../lib/api.js";
import { el } from "../../lib/dom.js";
import { clearBanner, showProblem } from "../banner.js";

const makeField = (name, label, hint, attributes) => [
  el("label", { for: `monitor-${name}` }, label),
  el("input", { id: `monitor-${name}`, name, "aria-describedby": `monitor-${name}-hint`, ...attributes }),
  el("span", { class: "soft small", id: `monitor-${name}-hint` }, hint),
];

/** Make the form, folded; the page of the new monitor opens. */
export function makeMonitorForm(job) {
  const submit = el("button", { type: "submit", class: "strong" }, "Create the monitor");

  async function create(event) {
    event.preventDefault();
    clearBanner("problem");
    submit.disabled = true;
    const { interval, training, ...given } = Object.fromEntries(new FormData(event.target));
    const numbers = { ...(interval && { interval: Number(interval) }), training: Number(training) };
    try {
      const monitor = await postJson("v1/monitors", { diagnosis: job.id, ...given, ...numbers });
      location.hash = `#/monitors/${monitor.id}`;
    } catch (error) {
      showProblem(error);
      submit.disabled = false;
    }
  }

  return el(
    "details",
    { class: "follow" },
    el("summary", {}, "Monitor later records with this diagnosis"),
    el(
      "form",
      { class: "fields", on: { submit: create } },
      makeField("name", "Name", "For display.", { maxlength: 200, value: job.name }),
      makeField("false_alarms", "False alarms", "A rate: 1 per month, 0.1/week or 1 per 720 records.", {
        required: true,
        value: "1 per month",
      }),
      makeField("interval", "Seconds between records", "The duration of the first record if it is empty.", {
        type: "number",
        min: "0",
        step: "any",
      }),
      makeField("training", "Records of the training", "The undisturbed state: at least 12 records.", {
        type: "number",
        min: "12",
        max: "10000",
        required: true,
        value: "24",
      }),
      submit,
    ),
  );
}
