/** Preset and settings of a search. The service describes both; only settings that are changed are sent. */

import { getJson } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";
import { findType, isNumber, makeInput } from "../lib/schema.js";

const format = (value) => {
  if (typeof value === "boolean") return value ? "yes" : "no";
  return Array.isArray(value) ? value.join(", ") : String(value);
};

/** Return the value that is written in a field; undefined if the field is empty. */
function readValue(text, type) {
  if (text.trim() === "") return undefined;
  if (type.type === "boolean") return text === "yes";
  if (type.type !== "array") return isNumber(type) ? Number(text) : text.trim();
  const items = text.split(",").map((each) => each.trim());
  const item = type.items ?? type.prefixItems?.[0] ?? {};
  return isNumber(item) ? items.map(Number) : items;
}

const makeField = (name, schema) =>
  makeInput(schema, { name, id: `setting-${name}`, "aria-describedby": `meaning-${name}` });

/** Settings that are shown next to the preset, before the others. */
const EVERYDAY = ["effort", "prefer"];

/** Preset whose structure is chosen next to it, and what its values mean. */
const LATENT = "latent";
const STRUCTURES = "auto: curves anywhere. wiener: only the output reads them. hammerstein: they read the "
  + "inputs only. feedback: they act on the states only.";

/** Make the choice of the structure of latent models; `show(isVisible)` shows or hides it. */
function makeStructure() {
  const select = el("select", { name: "structure", id: "structure", "aria-describedby": "structure-hint" });
  const nodes = [
    el("label", { for: "structure" }, "Structure"),
    select,
    el("span", { class: "soft small", id: "structure-hint" }, STRUCTURES),
  ];
  const show = (isVisible) => nodes.forEach((each) => (each.hidden = !isVisible));
  show(false);
  return { select, nodes, show };
}

/** Make the fields; `initial` has the `preset` and the `settings` of a request. */
export function makeSearchSettings(initial, onChange, signal) {
  const chosen = initial.preset ?? "auto";
  const preset = el("select", { name: "preset", id: "preset", "aria-describedby": "preset-hint" });
  preset.append(el("option", { value: chosen }, chosen));
  const hint = el("span", { class: "soft small", id: "preset-hint" });
  const list = el("div", { class: "settings" }, el("p", { class: "loading" }, "Loading…"));
  const everyday = el("div", { class: "settings" });
  const count = el("span", { class: "soft small" });
  const structure = makeStructure();
  let [presets, fields] = [[], new Map()];

  const findPreset = () => presets.find(({ name }) => name === preset.value) ?? {};

  function showPreset() {
    const { summary = "", settings = {}, fixed = [] } = findPreset();
    const isLatent = preset.value === LATENT;
    setText(hint, summary && `${summary}.`);
    structure.show(isLatent);
    for (const [name, { field, row, standard }] of fields) {
      row.hidden = fixed.includes(name) || (isLatent && name === "structure");
      const text = name in settings ? format(settings[name]) || "none" : "by the record";
      setText(standard, `Default: ${text}.`);
      if (field.tagName === "INPUT") field.placeholder = text;
      else setText(field.options[0], text);
    }
  }

  function getSettings() {
    if (!fields.size) return initial.settings ?? {};
    // A setting that the preset does not have keeps its value for another preset, and is not sent.
    const shown = [...fields].filter(([, { row }]) => !row.hidden);
    const values = shown.map(([name, { field, type }]) => [name, readValue(field.value, type)]);
    const isRestricted = preset.value === LATENT && structure.select.value !== "auto";
    return {
      ...Object.fromEntries(values.filter(([, value]) => value !== undefined)),
      ...(isRestricted && { structure: structure.select.value }),
    };
  }

  function update() {
    const changed = Object.keys(getSettings()).length;
    setText(count, changed ? ` ${changed} changed` : "");
    onChange();
  }

  function makeRow([name, schema]) {
    const type = findType(schema);
    const field = makeField(name, schema);
    const standard = el("span");
    const given = name === "structure" && chosen === LATENT ? null : initial.settings?.[name];
    if (given !== undefined && given !== null) field.value = format(given);
    // Grave accents mark code in the documentation.
    const meaning = schema.description.replaceAll("`", "");
    const row = el(
      "div",
      {},
      el("label", { for: field.id }, el("code", {}, name)),
      field,
      el("p", { class: "soft small", id: `meaning-${name}` }, `${meaning} `, standard),
    );
    fields.set(name, { field, row, type, standard });
    return row;
  }

  getJson("v1/presets", { signal }).then(
    ({ items, settings }) => {
      presets = items;
      fields = new Map();
      const text = (each) => el("option", { value: each.name }, each.name);
      preset.replaceChildren(...items.map(text));
      preset.value = chosen;
      const rows = Object.entries(settings).map((entry) => [entry[0], makeRow(entry)]);
      const take = (isEveryday) =>
        rows.filter(([name]) => EVERYDAY.includes(name) === isEveryday).map(([, row]) => row);
      everyday.replaceChildren(...take(true));
      list.replaceChildren(...take(false));
      const { structures } = items.find(({ name }) => name === LATENT);
      structure.select.replaceChildren(...structures.map((each) => el("option", { value: each }, each)));
      if (chosen === LATENT) structure.select.value = initial.settings?.structure ?? "auto";
      showPreset();
      update();
    },
    (error) => signal.aborted || list.replaceChildren(el("p", { class: "complaint" }, error.message)),
  );
  preset.addEventListener("input", () => {
    showPreset();
    update();
  });
  structure.select.addEventListener("input", update);
  [everyday, list].forEach((each) => each.addEventListener("input", update));
  return {
    nodes: [
      [
        el("div", { class: "fields" }, el("label", { for: "preset" }, "Preset"), preset, hint, structure.nodes),
        everyday,
      ],
      el("details", { open: Boolean(initial.settings) }, el("summary", {}, "Advanced settings", count), list),
    ],
    /** Return the fields `preset` and `settings` of a request. */
    getRequest() {
      const settings = getSettings();
      return { preset: preset.value, ...(Object.keys(settings).length && { settings }) };
    },
  };
}
