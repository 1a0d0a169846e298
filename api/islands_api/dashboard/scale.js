/** Scales of an axis: where a value lies, and which values are marked; linear or logarithmic. */

/** Steps of marks, as multiples of a power of ten; of a whole axis those that are whole. */
const STEPS = [1, 2, 2.5, 5, 10];

/** Values of a decade that are marked: the first of these that gives enough marks. */
const MANTISSAS = [[1], [1, 3], [1, 2, 5], [1, 2, 3, 4, 5, 6, 7, 8, 9]];

const FEWEST = 3;

/** Within less than this factor powers of ten say nothing, and round values lie evenly enough. */
const NARROW = 5;

/** What rounding may move a mark at the end of an axis by. */
const SLACK = 1e-9;

/** Return about so many round values between two. */
export function roundTicks(low, high, most, whole = false) {
  if (!(high > low)) return [low];
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough));
  const steps = STEPS.map((step) => step * power).filter((step) => !whole || Number.isInteger(step));
  const step = Math.max(steps.find((each) => each >= rough * (1 - SLACK)) ?? 1, whole ? 1 : 0);
  const ticks = [];
  for (let at = Math.ceil(low / step - SLACK); at * step <= high + SLACK * step; at += 1)
    ticks.push(Number((at * step).toPrecision(12)));
  return ticks;
}

/** Return the marks of a logarithmic axis: powers of ten, what lies between, or round values at worst. */
export function logTicks(low, high, most) {
  if (high / low < NARROW) return roundTicks(low, high, Math.min(5, most));
  const [first, last] = [Math.floor(Math.log10(low) + SLACK), Math.ceil(Math.log10(high) - SLACK)];
  for (const mantissas of MANTISSAS) {
    const ticks = [];
    for (let power = first; power <= last; power += 1)
      for (const mantissa of mantissas) {
        const value = Number(`${mantissa}e${power}`);
        if (value >= low * (1 - SLACK) && value <= high * (1 + SLACK)) ticks.push(value);
      }
    if (ticks.length > most) {
      const every = Math.ceil(ticks.length / most);
      return ticks.filter((_, at) => at % every === 0);
    }
    if (ticks.length >= FEWEST) return ticks;
  }
  return roundTicks(low, high, Math.min(4, most));
}

function widened(low, high, share) {
  const room = high > low ? (high - low) * share : Math.abs(low) * share || 1;
  return [low - room, high + room];
}

/**
 * Make a scale from values to pixels.
 * @returns {{at: (value: number) => number, back: (pixel: number) => number, ticks: number[]}}
 */
export function scale(values, [from, to], { log = false, whole = false, share = 0, most = 6 } = {}) {
  const bent = log ? Math.log10 : (value) => value;
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    const at = bent(value);
    if (at < low) low = at;
    if (at > high) high = at;
  }
  if (low > high) [low, high] = [0, 1];
  if (log && low === high) [low, high] = [low - 0.2, high + 0.2];
  else if (share || low === high) [low, high] = widened(low, high, share || 0.5);
  const ticks = log ? logTicks(10 ** low, 10 ** high, most) : roundTicks(low, high, most, whole);
  const unit = (to - from) / (high - low);
  return {
    at: (value) => from + (bent(value) - low) * unit,
    back: (pixel) => {
      const value = low + (pixel - from) / unit;
      return log ? 10 ** value : value;
    },
    ticks,
  };
}
