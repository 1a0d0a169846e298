/**
 * Samples of a signal plot: the extremes of all rows, and of the visible rows and their neighbours.
 *
 * One request at a time is on its way. Both answers are kept, so that every range is drawn at once, if only
 * coarsely.
 */

import { sleep } from "../lib/api.js";

/** Largest number of parts of a request, and parts of all rows for each pixel. */
const [MOST_POINTS, OVERVIEW] = [4000, 2];

/** Seconds between a change of the range and its request, in which it may change again. */
const PAUSE = 0.12;

/** Rows on each side of the visible ones that are requested with them, as a part of their number. */
const MARGIN = 0.5;

const toNumbers = (values) => Float64Array.from(values, (value) => value ?? NaN);

/** Convert an answer of the service: numbers in arrays, NaN for missing values. */
function convert({ rows, start, stop, columns }) {
  const entries = columns.map(({ name, minimum, maximum }) => [
    name,
    { minimum: toNumbers(minimum), maximum: toNumbers(maximum) },
  ]);
  return { rows: Float64Array.from(rows), start, stop, columns: new Map(entries) };
}

/** Return the place of the last part that begins at a row or before it; -1 if there is none. */
export function findPart(rows, row) {
  let [low, high] = [-1, rows.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (rows[middle] <= row) low = middle;
    else high = middle - 1;
  }
  return low;
}

/** Return the first part that shows a row, and the place behind the parts that begin before a row. */
const findFirst = ({ rows }, row) => Math.max(0, findPart(rows, row));
const findEnd = ({ rows }, row) => findPart(rows, Math.ceil(row) - 1) + 1;

/** Return whether an answer shows a range with a part for each pixel, or with every row. */
function resolves(answer, [start, stop], points) {
  if (answer === null || answer.start > start || answer.stop < stop) return false;
  const rows = (answer.stop - answer.start) / answer.rows.length;
  return rows <= 1 || rows <= (1.1 * (stop - start)) / points;
}

/** Return the first and the last row of a request for a range. */
function widen([start, stop], samples) {
  const margin = MARGIN * (stop - start);
  return [Math.max(0, Math.floor(start - margin)), Math.min(samples, Math.ceil(stop + margin))];
}

/**
 * Make the samples of a record of `samples` rows. `ask` is that of a signal plot. `changed()` is called after
 * every answer, `failed(error)` after a request without one.
 */
export function makeSamples(samples, ask, { changed, failed }, signal) {
  let [names, isBusy] = [[], false];
  let [wanted, answered, overview, detail] = [null, null, null, null];

  async function request([start, stop], points) {
    const asked = names;
    const found = convert(await ask(new URLSearchParams({ start, stop, points }), names));
    return asked === names ? found : null;
  }

  /** Request what is missing of the wanted range; return whether something was. */
  async function loadOnce() {
    const count = (pixels) => Math.max(1, Math.min(MOST_POINTS, Math.round(pixels)));
    if (overview?.names !== names) {
      const found = await request([0, samples], count(OVERVIEW * wanted.points));
      if (found) [overview, detail] = [{ ...found, names }, null];
      return true;
    }
    const isShown = [overview, detail].some((each) => resolves(each, wanted.range, wanted.points));
    if (isShown || wanted === answered) return false;
    await sleep(PAUSE, signal);
    answered = wanted;
    const found = await request(widen(answered.range, samples), count((1 + 2 * MARGIN) * answered.points));
    if (found) detail = found;
    return true;
  }

  async function load() {
    if (isBusy) return;
    isBusy = true;
    try {
      while (!signal.aborted && names.length && (await loadOnce())) changed();
    } catch (error) {
      if (!signal.aborted) failed(error);
    } finally {
      isBusy = false;
    }
  }

  return {
    /** Select the columns that are loaded. */
    select(chosen) {
      if (chosen.join("\n") !== names.join("\n")) names = chosen;
    },
    /** Load a range of rows for a width in pixels. */
    want(range, points) {
      wanted = { range, points };
      load();
    },
    isEmpty: () => overview === null,
    /** Return the answers that show a range, sorted by rows, with their parts from `first` to `last`. */
    find([start, stop]) {
      if (overview === null) return [];
      const show = (answer, first, last) => ({ ...answer, first, last: Math.min(last, answer.rows.length) });
      // One part more at the right, so that the line reaches the edge.
      const showAll = (answer) => show(answer, findFirst(answer, start), findEnd(answer, stop) + 1);
      const { first, last } = showAll(overview);
      if (detail === null || detail.stop <= start || detail.start >= stop) return [showAll(overview)];
      const found = [showAll(detail)];
      if (detail.start > start) found.unshift(show(overview, first, findEnd(overview, detail.start)));
      if (detail.stop < stop) found.push(show(overview, findEnd(overview, detail.stop), last));
      return found;
    },
  };
}
