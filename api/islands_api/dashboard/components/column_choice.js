/** Table of the columns of a data set, in which the inputs and the output are chosen. */

import { el, makeScrollable } from "../lib/dom.js";
import { formatNumber, formatShort } from "../lib/numbers.js";
import { STATISTICS, describeDefect } from "./dataset.js";

/** Return the headings; the sampling time is one of them if the columns have different ones. */
const listHeadings = (hasTimes) =>
  [
    ...["Column", "Unit", "Input", "Output"],
    ...[...(hasTimes ? ["Sampling time"] : []), ...STATISTICS].map((name) => [name, "figure"]),
    "Remark",
  ].map((heading) => [heading].flat());

/** Columns from which on those that have no role are hidden. */
const MANY = 8;

/** Return the column of a name in a request: `u_V+1` is the column `u_V` one sample early. */
const findColumn = (name, names) => (names.includes(name) ? name : name.replace(/\+1$/, ""));

/** Return the columns that are chosen at first: those of a request, or those that the service suggests. */
function findChoice({ inputs = [], output = "" }, { columns, inspection }) {
  const names = columns.map(({ name }) => name);
  const outputs = [output].flat();
  const isKnown = [...outputs, ...inputs.map((each) => findColumn(each, names))].every((each) =>
    names.includes(each),
  );
  return isKnown ? { inputs, output } : (inspection?.choice ?? { inputs: [], output: "" });
}

/**
 * Make the table of a preview. `initial` is a request whose columns are chosen; `onChange({inputs, output})`
 * is called at each change of the choice. A request of several outputs has several to choose from.
 */
export function makeColumnChoice(preview, initial, onChange) {
  const { columns, time } = preview;
  const suggested = findChoice(initial, preview);
  const names = columns.map(({ name }) => name);
  // The choice keeps the names of the request.
  const given = new Map(suggested.inputs.map((name) => [findColumn(name, names), name]));
  const outputs = [suggested.output].flat();
  const kind = outputs.length > 1 ? "checkbox" : "radio";
  const fields = columns
    .filter(({ name, problem }) => name !== time && !problem)
    .map(({ name }) => ({ name, ...makeFields(name, given.has(name), outputs.includes(name), kind) }));
  const byName = new Map(fields.map((each) => [each.name, each]));

  const inputOrder = suggested.inputs.map((name) => findColumn(name, names));
  const listInputs = () => listChecked("input", inputOrder);
  const listOutputs = () => listChecked("output", outputs);

  /** List the chosen columns of a role: those of the request in its order, which the result depends on. */
  function listChecked(role, order) {
    const checked = fields.filter((each) => each[role].checked).map(({ name }) => name);
    const rank = (name) => (order.includes(name) ? order.indexOf(name) : order.length);
    return checked.sort((one, other) => rank(one) - rank(other));
  }

  function getChoice() {
    const [first = "", ...others] = listOutputs();
    return {
      inputs: listInputs().map((name) => given.get(name) ?? name),
      output: others.length ? [first, ...others] : first,
    };
  }

  /** A column has one role: the last one that was chosen. */
  function update({ target }) {
    const { input, output } = byName.get(target.value);
    if (target.checked) (target === input ? output : input).checked = false;
    onChange(getChoice());
  }

  // Data sets of earlier versions do not state it.
  const times = columns.map(({ dt }) => dt).filter(Number.isFinite);
  const hasTimes = new Set(times).size > 1;

  const row = (column) => {
    const { name, unit, dt, minimum, maximum, mean, deviation } = column;
    const chosen = byName.get(name);
    const remark = name === time ? "time" : describeDefect(column);
    const isUsed = name === time || chosen?.input.checked || chosen?.output.checked;
    return el(
      "tr",
      { hidden: columns.length > MANY && !isUsed },
      el("th", { scope: "row" }, el("code", {}, el("bdi", {}, name))),
      el("td", {}, unit),
      el("td", {}, chosen?.input),
      el("td", {}, chosen?.output),
      hasTimes && el("td", { class: "figure" }, Number.isFinite(dt) ? `${formatShort(dt)} s` : ""),
      [minimum, maximum, mean, deviation].map((value) => el("td", { class: "figure" }, formatNumber(value))),
      el("td", { class: "soft small" }, remark),
    );
  };
  const head = listHeadings(hasTimes).map(([name, kind]) => el("th", { scope: "col", class: kind }, name));
  const rows = columns.map(row);
  const table = el(
    "table",
    { class: "choice", on: { change: update } },
    el("caption", { class: "visually-hidden" }, "Columns of the data set"),
    el("thead", {}, el("tr", {}, head)),
    el("tbody", {}, rows),
  );
  const hidden = rows.filter((each) => each.hidden);
  const showOthers = ({ currentTarget: button }) => {
    for (const each of hidden) each.hidden = false;
    hidden[0].querySelector("input")?.focus();
    button.remove();
  };
  const more = { type: "button", on: { click: showOthers } };
  const others = hidden.length > 0 && el("button", more, `Show ${hidden.length} other columns`);
  return {
    node: el("div", {}, [makeScrollable("Columns of the data set", table), others].filter(Boolean)),
    getChoice,
    /** Return the chosen columns as they are named in the file. */
    listColumns: () => [...listInputs(), ...listOutputs()],
  };
}

function makeFields(name, isInput, isOutput, kind) {
  const input = el("input", { type: "checkbox", value: name, "aria-label": `${name} is an input` });
  const label = { "aria-label": `${name} is ${kind === "radio" ? "the" : "an"} output` };
  const output = el("input", { type: kind, name: "output", value: name, ...label });
  input.checked = isInput;
  output.checked = isOutput;
  return { input, output };
}
