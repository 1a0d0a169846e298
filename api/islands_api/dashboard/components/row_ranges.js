/** Rows of estimation and validation: those of the default split, or two ranges that the user marks. */

import { announce, el, setText } from "../lib/dom.js";
import { formatCount } from "../lib/numbers.js";

/** Part of the rows at the end that validates by default. */
const FRACTION = 0.25;

const KINDS = ["estimation", "validation"];
const TITLES = { estimation: "Estimation", validation: "Validation" };

const format = (range) => range?.join(":") ?? "";

/** Parse `START:STOP` as the service does: negative numbers count from the end; null if it is no range. */
export function parseRange(text, rows) {
  const match = /^\s*(-?\d+)?\s*:\s*(-?\d+)?\s*$/.exec(text);
  if (!match) return null;
  const place = (given, missing) => {
    const at = given === undefined ? missing : Number(given);
    return Math.min(rows, Math.max(0, at < 0 ? at + rows : at));
  };
  const range = [place(match[1], 0), place(match[2], rows)];
  return range[0] < range[1] ? range : null;
}

/** Return the longest part of a range outside of another one; null if none remains. */
export function subtractRange(range, other) {
  if (range === null || range[1] <= other[0] || other[1] <= range[0]) return range;
  const parts = [
    [range[0], other[0]],
    [other[1], range[1]],
  ].filter(([start, stop]) => stop > start);
  return parts.sort((a, b) => b[1] - b[0] - (a[1] - a[0]))[0] ?? null;
}

/** Return the ranges of a request; its validation data may be those of another data set. */
function findRanges({ rows: given, validation = FRACTION }, dataset, rows) {
  const used = parseRange(given ?? ":", rows) ?? [0, rows];
  if (typeof validation !== "number") {
    const isOwn = validation.dataset === dataset;
    return { estimation: used, validation: isOwn ? parseRange(validation.rows ?? "", rows) : null };
  }
  const boundary = used[1] - Math.round((used[1] - used[0]) * validation);
  return { estimation: [used[0], boundary], validation: [boundary, used[1]] };
}

/** Return the rows from the first to the last one of both ranges. */
function findUnion({ estimation, validation }) {
  const bounds = [...(estimation ?? []), ...(validation ?? [])];
  return [Math.min(...bounds), Math.max(...bounds)];
}

/** Return the fields of a request that select rows. */
const selectFields = ({ rows, validation }) => ({
  ...(rows && { rows }),
  ...(validation !== undefined && { validation }),
});

/**
 * Make the fields of both ranges. `initial` has the `rows` and the `validation` of a request, which stay as
 * they are until a range is changed; `onChange()` is called after every change.
 */
export function makeRowRanges(dataset, rows, initial, onChange) {
  let given = selectFields(initial);
  let ranges = findRanges(given, dataset, rows);
  let isComplete = true;
  const note = el("p", { class: "soft small", role: "status" });
  const fields = Object.fromEntries(KINDS.map((kind) => [kind, makeField(kind)]));
  const reset = el("button", { type: "button", class: "quiet" }, "Default split");
  const node = el("div", { class: "ranges" }, Object.values(fields).map(({ label }) => label), reset, note);

  function makeField(kind) {
    const input = el("input", { name: kind, maxlength: 40, placeholder: "START:STOP", autocomplete: "off" });
    input.addEventListener("change", () => {
      const range = parseRange(input.value, rows);
      if (range === null) state(false, `${TITLES[kind]}: write START:STOP, for example 0:${rows}.`);
      else set(kind, range);
    });
    return { input, label: el("label", { class: kind }, `${TITLES[kind]} rows `, input) };
  }

  function state(complete, text) {
    isComplete = complete;
    note.classList.toggle("complaint", !complete);
    setText(note, text);
    onChange();
  }

  function show() {
    for (const kind of KINDS) fields[kind].input.value = format(ranges[kind]);
    const isSplit = ranges.validation === null && !given?.validation;
    if (ranges.estimation === null) state(false, "No rows remain for the estimation.");
    else state(true, isSplit ? "The last quarter of the estimation rows validates." : "");
  }

  function update(request) {
    given = request;
    ranges = findRanges(given, dataset, rows);
    show();
  }

  /** Set a range; the other one gives way. */
  function set(kind, range) {
    const other = KINDS.find((each) => each !== kind);
    const isForeign = typeof given?.validation === "object" && given.validation.dataset !== dataset;
    if (isForeign && kind === "estimation") {
      given = { ...given, rows: format(range) };
      ranges = findRanges(given, dataset, rows);
    } else {
      // As long as no range is marked, the other one takes the rest of the rows that are used.
      const rest = given === null || isForeign ? ranges[other] : findUnion(ranges);
      ranges = { [kind]: range, [other]: subtractRange(rest, range) };
      given = null;
    }
    show();
    announce(`${TITLES[kind]}: ${formatCount(range[1] - range[0])} rows`);
  }

  reset.addEventListener("click", () => update({}));
  return {
    node,
    set,
    getRanges: () => ranges,
    /** Use a part of the rows, with its end as validation data. */
    use: ([start, stop]) => update(start === 0 && stop === rows ? {} : { rows: `${start}:${stop}` }),
    isComplete: () => isComplete,
    /** Return the fields `rows` and `validation` of a request; none for the default split. */
    getRequest() {
      if (given !== null) return given;
      const { estimation, validation } = ranges;
      return {
        rows: format(estimation),
        // Without rows for it, the end of the estimation data validates.
        ...(validation && { validation: { dataset, rows: format(validation) } }),
      };
    },
    show,
  };
}
