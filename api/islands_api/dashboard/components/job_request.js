/** Form that submits a job: its fields, the same request for other programs, and the submission. */

import { postJson } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";
import { clearBanner, showProblem } from "./banner.js";

/** Make a field with its label and its hint; `form` begins the ids of its fields. */
export function makeField(form, label, field, hint) {
  field.id = `${form}-${field.name}`;
  field.setAttribute("aria-describedby", `${field.id}-hint`);
  return [
    el("label", { for: field.id }, label),
    field,
    el("span", { class: "soft small", id: `${field.id}-hint` }, hint),
  ];
}

/** Quote a text for a shell. */
export const quote = (text) =>
  /^[\w.,:/+=-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;

/** Return the address of the service, as other programs need it. */
export const getServiceUrl = () => location.href.replace(/[?#].*$/, "").replace(/\/$/, "");

/** Write a value of a request in Python. */
function toPython(value) {
  if (value === null) return "None";
  if (typeof value === "boolean") return value ? "True" : "False";
  if (typeof value !== "object") return JSON.stringify(value);
  if (Array.isArray(value)) return `[${value.map(toPython).join(", ")}]`;
  const entries = Object.entries(value).map(([name, each]) => `${JSON.stringify(name)}: ${toPython(each)}`);
  return `{${entries.join(", ")}}`;
}

/**
 * Return the commands that submit a request: the command of `islands jobs` with its options and the lines
 * before it, the method of the Python client, and the path of REST. Without options, no command line exists.
 */
function describeRequest({ path, call, command, options, before = [] }, request) {
  const url = getServiceUrl();
  const line = options && `islands jobs ${command} ${quote(request.name)} ${options.join(" ")}`;
  const { settings = {}, ...fields } = request;
  return {
    ...(line && { "Command line": [...before, `${line} \\`, `  --url ${url} --watch`].join("\n") }),
    Python: [
      "from islands_api import Client",
      "",
      `job = Client(${JSON.stringify(url)}).${call}(`,
      ...Object.entries({ ...fields, ...settings }).map(([name, value]) => `    ${name}=${toPython(value)},`),
      ")",
    ].join("\n"),
    curl: [
      `curl ${url}/${path} -H 'Content-Type: application/json' \\`,
      `  -d ${quote(JSON.stringify(request))}`,
    ].join("\n"),
  };
}

/**
 * Make the form of a job. `makeRequest()` returns the request, or null if it is incomplete;
 * `describe(request)` its form for other programs; `explain(request)` a text for its button; `fields(row)`
 * the content above the commands, with the row of the button. `update()` shows a changed request.
 */
export function makeJobForm({ action, path, makeRequest, describe, explain, fields }) {
  const submit = el("button", { type: "submit", class: "strong" }, action);
  const chosen = el("p");
  const commands = el("div");

  function update() {
    const request = makeRequest();
    submit.disabled = request === null;
    setText(chosen, explain(request));
    const described = request === null ? {} : describeRequest({ path, ...describe(request) }, request);
    const blocks = Object.entries(described).flatMap(([title, command]) => [
      el("h3", {}, title),
      el("pre", { tabindex: "0" }, el("code", {}, command)),
    ]);
    commands.replaceChildren(...blocks);
  }

  async function run(event) {
    event.preventDefault();
    clearBanner("problem");
    submit.disabled = true;
    try {
      const job = await postJson(path, makeRequest());
      location.hash = `#/jobs/${job.id}`;
    } catch (error) {
      showProblem(error);
      submit.disabled = false;
    }
  }

  const row = el("div", { class: "row" }, submit, chosen);
  const same = el("details", {}, el("summary", {}, "The same as a command"), commands);
  const node = el("form", { class: "run", on: { submit: run, input: update } }, fields(row), same);
  return { node, update };
}
