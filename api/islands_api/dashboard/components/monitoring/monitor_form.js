/** Form that creates a monitor of the simulation of a diagnosis. */

import { postJson } from "../../lib/api.js";
import { el } from "../../lib/dom.js";
import { getFields, makeInput } from "../../lib/schema.js";
import { clearBanner, showProblem } from "../banner.js";

/** Labels of the fields. */
const LABELS = {
  name: "Name",
  false_alarms: "False alarms",
  interval: "Seconds between records",
  training: "Records of the training",
};

function makeField(name, schema, value) {
  const id = `monitor-${name}`;
  const required = Boolean(schema.default);
  return [
    el("label", { for: id }, LABELS[name]),
    makeInput(schema, { id, name, required, "aria-describedby": `${id}-hint`, ...(value && { value }) }),
    el("span", { class: "soft small", id: `${id}-hint` }, schema.description),
  ];
}

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

  const form = el("form", { class: "fields", on: { submit: create } });

  async function open() {
    if (form.childElementCount) return;
    form.replaceChildren(el("p", { class: "loading" }, "Loading…"));
    try {
      const fields = await getFields("MonitorRequest");
      const made = Object.keys(LABELS).flatMap((name) => makeField(name, fields[name], job[name]));
      form.replaceChildren(...made, submit);
    } catch (error) {
      form.replaceChildren();
      showProblem(error);
    }
  }

  const title = el("summary", {}, "Monitor later records with this diagnosis");
  return el("details", { class: "follow", on: { toggle: open } }, title, form);
}
