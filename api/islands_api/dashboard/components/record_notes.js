/** Problems of a record and remarks on it, with their rows, and buttons for the options that help. */

import { el } from "../lib/dom.js";
import { formatShort } from "../lib/numbers.js";

/** Names of the values of an option. */
const VALUES = {
  gaps: { split: "Split at gaps", interpolate: "Fill gaps" },
  outliers: { keep: "Keep outliers", exclude: "Leave outliers out" },
  rates: {
    mean: "Average faster columns",
    sample: "Sample faster columns",
    rows: "Take every row as a sample",
  },
};

/** Names of options with other values; `value` is empty if the user has to give it. */
const NAMES = {
  resample: (value) => `Resample to ${value} s`,
  dt: (value) => `Sampling time ${value} s`,
  missing: (value) => `Read ${value} as missing`,
  time: (value) => `Time column ${value}`,
  time_unit: (value) => `Unit of time ${value}`,
  decimal: (value) => `Decimal ${value}`,
  dates: (value) => `Dates ${value}`,
  timezone: (value) => `Time zone ${value}`,
  sheet: (value) => `Sheet or group ${value}`,
};

const TIME_UNITS = ["s", "ms", "us", "ns", "min", "h", "d"];

const NUMBERS = ["resample", "dt"];

const format = (value) => (typeof value === "number" ? formatShort(value) : [value].flat().join(", "));

/** Return an option with its value in words. */
const describe = (option, value) =>
  VALUES[option]?.[value] ?? NAMES[option]?.(format(value)) ?? `${option}: ${format(value)}`;

/** Return options of reading in words. */
export const describeReading = (reading) =>
  Object.entries(reading).map((each) => describe(...each)).join("; ").toLowerCase();

/** Return the notes of a preview; data sets of earlier versions have texts alone. */
export const getNotes = ({ notes, warnings }) =>
  notes?.length ? notes : warnings.map((text) => ({ text, is_problem: false, rows: [], advice: [] }));

/** Make the paragraph of a note: only a problem is a complaint. */
export const makeNoteText = ({ text, is_problem: isProblem }) =>
  el("p", { class: isProblem ? "complaint" : "remark" }, text);

/** Make a field for an option whose value only the user knows. */
function makeOptionField(option, columns, apply) {
  const choices = { time: columns.map(({ name }) => name), time_unit: TIME_UNITS }[option];
  const label = { "aria-label": describe(option, "").trim(), required: true };
  const type = NUMBERS.includes(option) ? { type: "number", step: "any", min: 0 } : { type: "text" };
  const field = choices
    ? el("select", label, choices.map((each) => el("option", {}, each)))
    : el("input", { ...label, ...type, maxlength: 200 });
  const submit = (event) => {
    event.preventDefault();
    apply(option, NUMBERS.includes(option) ? Number(field.value) : field.value);
  };
  const name = NUMBERS.includes(option) ? describe(option, "").replace(/ +s$/, " (s)") : describe(option, "");
  return el(
    "form",
    { class: "option", on: { submit } },
    el("span", { "aria-hidden": "true" }, name.replace(/ to\b/, "")),
    field,
    el("button", { type: "submit" }, "Set"),
  );
}

function makeRemedies(note, columns, apply) {
  return note.advice.map(({ option, value }) =>
    value === null
      ? makeOptionField(option, columns, apply)
      : el("button", { type: "button", on: { click: () => apply(option, value) } }, describe(option, value)),
  );
}

/** Make the list of the options that are set, each with a button that removes it. */
function makeSetOptions(set, remove) {
  return Object.entries(set).map(([option, value]) => {
    const text = describe(option, value);
    const label = { "aria-label": `Do not use: ${text}` };
    const click = () => remove(option);
    return el("li", {}, el("button", { type: "button", ...label, on: { click } }, `${text} ✕`));
  });
}

/**
 * Make the notes of a preview. `read(reading)` reads the record with these options, `setSamplingTime(dt)`
 * sets that of the request, and `showRows(rows)` shows rows in the plot.
 */
export function makeRecordNotes(preview, { read, setSamplingTime, showRows }) {
  const { reading = {}, inspection, columns } = preview;
  const remedy = inspection?.remedy ?? {};
  const change = (changes) => {
    const missing = [reading.missing, changes.missing].flat().filter(Boolean);
    read({ ...reading, ...changes, ...(missing.length && { missing }) });
  };
  const apply = (option, value) => (option === "dt" ? setSamplingTime(value) : change({ [option]: value }));
  const remove = (option) => {
    const { [option]: _, ...others } = reading;
    read(others);
  };
  const items = getNotes(preview).map((note) =>
    el(
      "li",
      { class: note.is_problem ? "problem" : null },
      makeNoteText(note),
      el(
        "div",
        { class: "row" },
        note.rows.length > 0 &&
          el("button", { type: "button", on: { click: () => showRows(note.rows) } }, "Show in the plot"),
        makeRemedies(note, columns, apply),
      ),
    ),
  );
  const set = makeSetOptions(reading, remove);
  return [
    set.length > 0 &&
      el("div", { class: "set" }, el("h3", {}, "Read with"), el("ul", { class: "row options" }, set)),
    Object.keys(remedy).length > 0 &&
      el(
        "p",
        { class: "row" },
        el("button", { type: "button", class: "strong", on: { click: () => change(remedy) } }, "Repair"),
        `The record can be used with: ${describeReading(remedy)}.`,
      ),
    items.length > 0 && el("ul", { class: "notes" }, items),
  ].filter(Boolean);
}
