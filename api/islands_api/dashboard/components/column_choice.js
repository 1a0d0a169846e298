/** Table of the columns of a data set, in which the inputs and the output are chosen. */

import { el, makeScrollable } from "../lib/dom.js";
import { formatNumber } from "../lib/numbers.js";
import { STATISTICS, describeDefect } from "./dataset.js";

const HEADINGS = [
  ...["Column", "Unit", "Input", "Output"],
  ...STATISTICS.map((name) => [name, "figure"]),
  "Remark",
].map((heading) => [heading].flat());

/** Make the table of a preview; `onChange({inputs, output})` is called at each change of the choice. */
export function makeColumnChoice({ columns, time, inspection }, onChange) {
  const suggested = inspection?.choice ?? { inputs: [], output: "" };
  const fields = columns
    .filter(({ name, problem }) => name !== time && !problem)
    .map(({ name }) => ({ name, ...makeFields(name, suggested) }));
  const byName = new Map(fields.map((each) => [each.name, each]));

  const getChoice = () => ({
    inputs: fields.filter(({ input }) => input.checked).map(({ name }) => name),
    output: fields.find(({ output }) => output.checked)?.name ?? "",
  });

  /** A column has one role: the last one that was chosen. */
  function update({ target }) {
    const { input, output } = byName.get(target.value);
    if (target.checked) (target === input ? output : input).checked = false;
    onChange(getChoice());
  }

  const row = (column) => {
    const { name, unit, minimum, maximum, mean, deviation } = column;
    const chosen = byName.get(name);
    const remark = name === time ? "time" : describeDefect(column);
    return el(
      "tr",
      {},
      el("th", { scope: "row" }, el("code", {}, el("bdi", {}, name))),
      el("td", {}, unit),
      el("td", {}, chosen?.input),
      el("td", {}, chosen?.output),
      [minimum, maximum, mean, deviation].map((value) => el("td", { class: "figure" }, formatNumber(value))),
      el("td", { class: "soft small" }, remark),
    );
  };
  const head = HEADINGS.map(([name, kind]) => el("th", { scope: "col", class: kind }, name));
  const table = el(
    "table",
    { class: "choice", on: { change: update } },
    el("caption", { class: "visually-hidden" }, "Columns of the data set"),
    el("thead", {}, el("tr", {}, head)),
    el("tbody", {}, columns.map(row)),
  );
  return { node: makeScrollable("Columns of the data set", table), getChoice };
}

function makeFields(name, { inputs, output }) {
  const input = el("input", { type: "checkbox", value: name, "aria-label": `${name} is an input` });
  const label = { "aria-label": `${name} is the output` };
  const radio = el("input", { type: "radio", name: "output", value: name, ...label });
  input.checked = inputs.includes(name);
  radio.checked = output === name;
  return { input, output: radio };
}
