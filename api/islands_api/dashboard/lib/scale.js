/** Linear and logarithmic axis scales: positions of values, and ticks. */

/** Tick spacings as multiples of a power of ten; an integer axis uses only integer spacings. */
const STEPS = [1, 2, 2.5, 5, 10];

/** Ticks within a decade: the first set that gives enough ticks is used. */
const MANTISSAS = [[1], [1, 3], [1, 2, 5], [1, 2, 3, 4, 5, 6, 7, 8, 9]];

/** Minimum number of ticks of a logarithmic axis. */
const MIN_TICKS = 3;

/** Ratio of the limits below which a logarithmic axis has equally spaced ticks instead of powers of ten. */
const MIN_LOG_RATIO = 5;

/** Relative rounding tolerance for ticks at the ends of an axis. */
const TOLERANCE = 1e-9;

/** Return at most about `maxTicks` round values between two limits. */
export function roundTicks(low, high, maxTicks, integer = false) {
  if (!(high > low)) return [low];
  const rough = (high - low) / maxTicks;
  const power = 10 ** Math.floor(Math.log10(rough));
  const steps = STEPS.map((step) => step * power).filter((step) => !integer || Number.isInteger(step));
  const step = Math.max(steps.find((each) => each >= rough * (1 - TOLERANCE)) ?? 1, integer ? 1 : 0);
  const ticks = [];
  for (let at = Math.ceil(low / step - TOLERANCE); at * step <= high + TOLERANCE * step; at += 1)
    ticks.push(Number((at * step).toPrecision(12)));
  return ticks;
}

/** Return the ticks of a logarithmic axis: powers of ten, values within decades, or round values. */
export function logTicks(low, high, maxTicks) {
  if (high / low < MIN_LOG_RATIO) return roundTicks(low, high, Math.min(5, maxTicks));
  const [first, last] = [Math.floor(Math.log10(low) + TOLERANCE), Math.ceil(Math.log10(high) - TOLERANCE)];
  for (const mantissas of MANTISSAS) {
    const ticks = [];
    for (let power = first; power <= last; power += 1)
      for (const mantissa of mantissas) {
        const value = Number(`${mantissa}e${power}`);
        if (value >= low * (1 - TOLERANCE) && value <= high * (1 + TOLERANCE)) ticks.push(value);
      }
    if (ticks.length > maxTicks) {
      const stride = Math.ceil(ticks.length / maxTicks);
      return ticks.filter((_, at) => at % stride === 0);
    }
    if (ticks.length >= MIN_TICKS) return ticks;
  }
  return roundTicks(low, high, Math.min(4, maxTicks));
}

function pad(low, high, padding) {
  const margin = high > low ? (high - low) * padding : Math.abs(low) * padding || 1;
  return [low - margin, high + margin];
}

/**
 * Make a scale from values to pixels.
 * @returns {{at: (value: number) => number, back: (pixel: number) => number, ticks: number[]}}
 */
export function makeScale(values, [from, to], options = {}) {
  const { log = false, integer = false, padding = 0, maxTicks = 6 } = options;
  const transform = log ? Math.log10 : (value) => value;
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    const at = transform(value);
    if (at < low) low = at;
    if (at > high) high = at;
  }
  if (low > high) [low, high] = [0, 1];
  if (log && low === high) [low, high] = [low - 0.2, high + 0.2];
  else if (padding || low === high) [low, high] = pad(low, high, padding || 0.5);
  const ticks = log ? logTicks(10 ** low, 10 ** high, maxTicks) : roundTicks(low, high, maxTicks, integer);
  const pixelsPerUnit = (to - from) / (high - low);
  return {
    at: (value) => from + (transform(value) - low) * pixelsPerUnit,
    back: (pixel) => {
      const value = low + (pixel - from) / pixelsPerUnit;
      return log ? 10 ** value : value;
    },
    ticks,
  };
}
