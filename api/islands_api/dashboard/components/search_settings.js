/** Preset and settings of a search. The service describes both; only settings that are changed are sent. */

import { getJson } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";

const format = (value) => {
  if (typeof value === "boolean") return value ? "yes" : "no";
  return Array.isArray(value) ? value.join(", ") : String(value);
};

/** Return the type of a setting that is not null. */
const findType = ({ anyOf = [], ...schema }) => anyOf.find(({ type }) => type !== "null") ?? schema;

const isNumber = ({ type }) => type === "integer" || type === "number";

/** Return the value that is written in a field; undefined if the field is empty. */
function readValue(text, type) {
  if (text.trim() === "") return undefined;
  if (type.type === "boolean") return text === "yes";
  if (type.type !== "array") return isNumber(type) ? Number(text) : text.trim();
  const items = text.split(",").map((each) => each.trim());
  const item = type.items ?? type.prefixItems?.[0] ?? {};
  return isNumber(item) ? items.map(Number) : items;
}

function makeField(name, type) {
  const names = { name, id: `setting-${name}`, "aria-describedby": `meaning-${name}` };
  if (type.type === "boolean")
    return el("select", names, ["", "yes", "no"].map((value) => el("option", { value }, value)));
  const kind = isNumber(type) ? "number" : "text";
  const step = type.type === "integer" ? 1 : "any";
  return el("input", { ...names, type: kind, step, maxlength: 500, autocomplete: "off" });
}

/** Make the fields; `initial` has the `preset` and the `settings` of a request. */
export function makeSearchSettings(initial, onChange, signal) {
  const chosen = initial.preset ?? "auto";
  const preset = el("select", { name: "preset", id: "preset", "aria-describedby": "preset-hint" });
  preset.append(el("option", { value: chosen }, chosen));
  const hint = el("span", { class: "soft small", id: "preset-hint" });
  const list = el("div", { class: "settings" }, el("p", { class: "loading" }, "Loading…"));
  const count = el("span", { class: "soft small" });
  let [presets, fields] = [[], new Map()];

  function showPreset() {
    const { summary = "", settings = {} } = presets.find(({ name }) => name === preset.value) ?? {};
    setText(hint, summary && `${summary}.`);
    for (const [name, { field, standard }] of fields) {
      const text = name in settings ? format(settings[name]) || "none" : "by the record";
      setText(standard, `Default: ${text}.`);
      if (field.tagName === "INPUT") field.placeholder = text;
    }
  }

  function getSettings() {
    if (!fields.size) return initial.settings ?? {};
    const values = [...fields].map(([name, { field, type }]) => [name, readValue(field.value, type)]);
    return Object.fromEntries(values.filter(([, value]) => value !== undefined));
  }

  function update() {
    const changed = Object.keys(getSettings()).length;
    setText(count, changed ? ` ${changed} changed` : "");
    onChange();
  }

  function makeRow([name, schema]) {
    const type = findType(schema);
    const field = makeField(name, type);
    const standard = el("span");
    const given = initial.settings?.[name];
    if (given !== undefined && given !== null) field.value = format(given);
    fields.set(name, { field, type, standard });
    // Double grave accents mark code in the documentation.
    const meaning = schema.description.replaceAll("``", "");
    return el(
      "div",
      {},
      el("label", { for: field.id }, el("code", {}, name)),
      field,
      el("p", { class: "soft small", id: `meaning-${name}` }, `${meaning} `, standard),
    );
  }

  getJson("v1/presets", { signal }).then(
    ({ items, settings }) => {
      presets = items;
      fields = new Map();
      const text = (each) => el("option", { value: each.name }, each.name);
      preset.replaceChildren(...items.map(text));
      preset.value = chosen;
      list.replaceChildren(...Object.entries(settings).map(makeRow));
      showPreset();
      update();
    },
    (error) => signal.aborted || list.replaceChildren(el("p", { class: "complaint" }, error.message)),
  );
  preset.addEventListener("input", showPreset);
  list.addEventListener("input", update);
  return {
    nodes: [
      el("div", { class: "fields" }, el("label", { for: "preset" }, "Preset"), preset, hint),
      el("details", { open: Boolean(initial.settings) }, el("summary", {}, "Advanced settings", count), list),
    ],
    /** Return the fields `preset` and `settings` of a request. */
    getRequest() {
      const settings = getSettings();
      return { preset: preset.value, ...(Object.keys(settings).length && { settings }) };
    },
  };
}
