/** Reference of the REST interface at `docs`: routes, parameters and schemas of `openapi.json`. */

import { showProblem } from "./components/banner.js";
import { getJson } from "./lib/api.js";
import { el, makeScrollable, makeTable } from "./lib/dom.js";

const main = document.getElementById("main");

const nameOf = (reference) => reference.split("/").at(-1);

/** Return a text whose parts between backticks are code. */
const withCode = (text) => text.split("`").map((part, at) => (at % 2 ? el("code", {}, part) : part));

const paragraphs = (text = "") =>
  text.split(/\n{2,}/).filter(Boolean).map((part) => el("p", {}, withCode(part)));

/** Return the limits of a value as words. */
function describeLimits(schema) {
  const { minimum, maximum, exclusiveMinimum: above, exclusiveMaximum: below, maxLength, maxItems } = schema;
  return [
    minimum !== undefined && `at least ${minimum}`,
    above !== undefined && `above ${above}`,
    maximum !== undefined && `at most ${maximum}`,
    below !== undefined && `below ${below}`,
    maxLength !== undefined && `at most ${maxLength} characters`,
    maxItems !== undefined && `at most ${maxItems} entries`,
    schema.default !== undefined && schema.default !== null && `default ${JSON.stringify(schema.default)}`,
  ].filter(Boolean).map((limit) => `, ${limit}`).join("");
}

const joinAll = (parts, word) => parts.flatMap((part, at) => (at ? [word, ...part] : part));

/** Return the type of a schema as text and links to schemas. */
function describeType(schema) {
  if (schema.$ref) return [el("a", { href: `#${nameOf(schema.$ref)}` }, nameOf(schema.$ref))];
  const choices = schema.anyOf ?? schema.oneOf ?? schema.allOf;
  if (choices) return [...joinAll(choices.map(describeType), " or "), describeLimits(schema)];
  if (schema.const !== undefined) return [JSON.stringify(schema.const)];
  if (schema.enum) return [schema.enum.join(", "), describeLimits(schema)];
  if (schema.type === "array") {
    const { items, prefixItems: first } = schema;
    const content = first ? joinAll(first.map(describeType), ", ") : describeType(items ?? {});
    return ["list of ", ...content, describeLimits(schema)];
  }
  if (schema.type === "object" && typeof schema.additionalProperties === "object")
    return ["object of ", ...describeType(schema.additionalProperties)];
  return [schema.type ?? "any value", describeLimits(schema)];
}

const scroll = (label, table) => makeScrollable(label, table);

function makeParameters(id, parameters = []) {
  if (!parameters.length) return null;
  const rows = parameters.map(({ name, in: place, required, schema, description }) => [
    el("code", {}, name),
    `${place}${required ? ", required" : ""}`,
    describeType(schema),
    withCode(description ?? schema.description ?? ""),
  ]);
  const title = `Parameters of ${id}`;
  return scroll(title, makeTable(title, ["parameter", "place", "type", "meaning"], rows));
}

function describeContent(content = {}) {
  const parts = Object.entries(content);
  return joinAll(parts.map(([type, { schema }]) => [`${type}: `, ...describeType(schema ?? {})]), "; ");
}

function makeResponses(id, responses) {
  const rows = Object.entries(responses).map(([status, { description, content, headers }]) => [
    status === "default" ? "error" : status,
    withCode(description ?? ""),
    describeContent(content),
    Object.keys(headers ?? {}).join(", "),
  ]);
  const title = `Responses of ${id}`;
  return scroll(title, makeTable(title, ["status", "meaning", "content", "headers"], rows));
}

function makeOperation(path, method, operation) {
  const { operationId: id, description = "", parameters, requestBody, responses, security } = operation;
  const [first, ...others] = description.split(/\n{2,}/);
  return el(
    "details",
    { class: "card", id, "data-text": `${method} ${path} ${description}`.toLowerCase() },
    el(
      "summary",
      {},
      el("span", { class: "method" }, method.toUpperCase()),
      el("code", {}, path),
      el("span", { class: "soft" }, withCode(first)),
    ),
    el(
      "div",
      { class: "body" },
      paragraphs(others.join("\n\n")),
      security ? null : el("p", { class: "soft" }, "Needs no key."),
      makeParameters(id, parameters),
      requestBody ? el("p", {}, "Body: ", describeContent(requestBody.content)) : null,
      makeResponses(id, responses),
    ),
  );
}

function makeSchema([name, schema]) {
  const required = new Set(schema.required);
  const rows = Object.entries(schema.properties ?? {}).map(([key, value]) => [
    el("code", {}, key),
    [...describeType(value), required.has(key) ? ", required" : ""],
    withCode(value.description ?? ""),
  ]);
  const title = `Members of ${name}`;
  const body = rows.length
    ? scroll(title, makeTable(title, ["member", "type", "meaning"], rows))
    : el("p", {}, describeType(schema));
  return el(
    "details",
    { class: "card", id: name, "data-text": `${name} ${schema.description ?? ""}`.toLowerCase() },
    el("summary", {}, el("code", {}, name)),
    el("div", { class: "body" }, paragraphs(schema.description), body),
  );
}

/** Group the operations by their first tag, in the order of the document. */
function groupOperations(paths) {
  const groups = new Map();
  for (const [path, operations] of Object.entries(paths))
    for (const [method, operation] of Object.entries(operations)) {
      const [tag] = operation.tags ?? ["others"];
      groups.set(tag, [...(groups.get(tag) ?? []), makeOperation(path, method, operation)]);
    }
  return [...groups].flatMap(([tag, made]) => [el("h2", {}, tag), ...made]);
}

/** Show the entries that contain a text. */
function filter(text) {
  const wanted = text.trim().toLowerCase();
  for (const entry of main.querySelectorAll("details")) entry.hidden = !entry.dataset.text.includes(wanted);
}

function openTarget() {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (!(target instanceof HTMLDetailsElement)) return;
  Object.assign(target, { open: true, hidden: false });
  target.scrollIntoView();
  target.querySelector("summary").focus({ preventScroll: true });
}

async function start() {
  const { info, paths, components } = await getJson("openapi.json");
  const field = el("input", { type: "search", on: { input: () => filter(field.value) } });
  main.replaceChildren(
    el("h1", {}, `REST interface, version ${info.version}`),
    ...paragraphs(info.description),
    el("p", {}, el("a", { href: "openapi.json" }, "openapi.json"), " is the same for programs."),
    el("label", { class: "search-field" }, "Find", field),
    ...groupOperations(paths),
    el("h2", {}, "Schemas"),
    ...Object.entries(components.schemas).map(makeSchema),
  );
  addEventListener("hashchange", openTarget);
  openTarget();
}

start().catch(showProblem);
