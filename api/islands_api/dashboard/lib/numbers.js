/** Number formatting: significant digits, thin spaces, units of time and size. */

export const NONE = "–";

const SUPERSCRIPTS = { "-": "⁻", ...[..."⁰¹²³⁴⁵⁶⁷⁸⁹"] };

/** Maximum number of decimals of a value with an interval that is written without a power of ten. */
const MAX_DECIMALS = 8;

/** Format a number with a number of significant digits; a dash if it is not finite. */
export function formatNumber(value, digits = 3) {
  if (typeof value !== "number" || !Number.isFinite(value)) return NONE;
  if (value === 0) return "0";
  const size = Math.abs(value);
  let text;
  if (size < 1e-3 || size >= 1e6) {
    const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
    text = `${mantissa}×10${[...String(Number(exponent))].map((sign) => SUPERSCRIPTS[sign]).join("")}`;
  } else {
    text = size >= 10 ** digits ? value.toFixed(0) : value.toPrecision(digits);
  }
  return text.replace("-", "−");
}

/** Format a number without trailing zeros: `4`, `0.5`, `1×10⁻⁶`. */
export function formatShort(value) {
  const text = formatNumber(value, 12);
  const [mantissa, exponent] = text.split("×");
  const trimmed = mantissa.includes(".") ? mantissa.replace(/\.?0+$/, "") : mantissa;
  return exponent === undefined ? trimmed : `${trimmed}×${exponent}`;
}

/** Format a value and half the length of its interval, both to two digits of the latter: `99.831 ± 0.062`. */
export function formatInterval(value, half) {
  if (!Number.isFinite(value) || !(half > 0)) return formatNumber(value);
  const size = Math.max(Math.abs(value), half);
  const decimals = 1 - Math.floor(Math.log10(half));
  if (decimals >= 0 && decimals <= MAX_DECIMALS && size < 1e6)
    return `${value.toFixed(decimals).replace("-", "−")} ± ${half.toFixed(decimals)}`;
  const digits = Math.floor(Math.log10(size)) + decimals + 1;
  return `${formatNumber(value, Math.min(12, Math.max(2, digits)))} ± ${formatNumber(half, 2)}`;
}

/** Label a quantity with its unit, unless its name ends in the unit in brackets: `u_V (V)`, `CH1 [V]`. */
export const labelQuantity = (name, unit) =>
  !unit || name.endsWith(`[${unit}]`) || name.endsWith(`(${unit})`) ? name : `${name} (${unit})`;

/** Format a count with thousands separators. */
export const formatCount = (value) =>
  Number.isFinite(value) ? Math.round(value).toLocaleString("en").replaceAll(",", "\u202f") : NONE;

/** Name what the size of a model counts: models of other classes than NARX have parameters with names. */
export const nameParts = (kind) => (kind && kind !== "narx" ? "parameters" : "terms");

/** Name the size of a model of a class in a heading. */
export const nameSize = (kind) => nameParts(kind).replace(/^./, (initial) => initial.toUpperCase());

/** Format the size of a model of a class. */
export const formatSize = (size, kind) =>
  `${size} ${size === 1 ? nameParts(kind).slice(0, -1) : nameParts(kind)}`;

/** Format a value in per cent. */
export const formatPercent = (value, digits = 3) =>
  Number.isFinite(value) ? `${formatNumber(value, digits)} %` : NONE;

const UNITS = [
  [86400, "d"],
  [3600, "h"],
  [60, "min"],
  [1, "s"],
];

/** Format a duration with its two largest units: `2 h 5 min`. */
export function formatDuration(seconds) {
  if (!Number.isFinite(seconds)) return NONE;
  if (seconds < 10) return `${Math.max(0, seconds).toFixed(1)} s`;
  const rounded = Math.round(seconds);
  const at = UNITS.findIndex(([size]) => rounded >= size);
  const [[size, unit], [minor, minorUnit] = [1, ""]] = UNITS.slice(at, at + 2);
  const rest = Math.floor((rounded % size) / minor);
  const first = `${Math.floor(rounded / size)} ${unit}`;
  return rest && minorUnit ? `${first} ${rest} ${minorUnit}` : first;
}

/** Format the size of a file. */
export function formatBytes(value) {
  const exponent = Math.min(3, Math.max(0, Math.floor(Math.log10(value || 1) / 3)));
  return `${formatNumber(value / 1000 ** exponent)} ${["B", "kB", "MB", "GB"][exponent]}`;
}

/** Format a value with its unit; null if it is unknown. */
export const formatQuantity = (value, unit) =>
  Number.isFinite(value) ? `${formatNumber(value)} ${unit}`.trim() : null;
