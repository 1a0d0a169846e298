/** Numbers as people read them: significant digits, thin spaces, units of time and size. */

export const NONE = "–";

const RAISED = { "-": "⁻", ...[..."⁰¹²³⁴⁵⁶⁷⁸⁹"] };

/** Write a number with so many significant digits; a dash where there is none. */
export function number(value, digits = 3) {
  if (typeof value !== "number" || !Number.isFinite(value)) return NONE;
  if (value === 0) return "0";
  const size = Math.abs(value);
  let text;
  if (size < 1e-3 || size >= 1e6) {
    const [mantissa, power] = value.toExponential(digits - 1).split("e");
    text = `${mantissa}×10${[...String(Number(power))].map((sign) => RAISED[sign]).join("")}`;
  } else {
    text = size >= 10 ** digits ? value.toFixed(0) : value.toPrecision(digits);
  }
  return text.replace("-", "−");
}

/** Write a number as short as it can be read back: `4`, `0.5`, `1×10⁻⁶`. */
export function short(value) {
  const text = number(value, 12);
  const [mantissa, power] = text.split("×");
  const trimmed = mantissa.includes(".") ? mantissa.replace(/\.?0+$/, "") : mantissa;
  return power === undefined ? trimmed : `${trimmed}×${power}`;
}

/** Write a count, its thousands apart. */
export const count = (value) =>
  Number.isFinite(value) ? Math.round(value).toLocaleString("en").replaceAll(",", "\u202f") : NONE;

/** Write a value in per cent. */
export const percent = (value, digits = 3) =>
  Number.isFinite(value) ? `${number(value, digits)} %` : NONE;

const UNITS = [
  [86400, "d"],
  [3600, "h"],
  [60, "min"],
  [1, "s"],
];

/** Write a time span by its two greatest units: `2 h 5 min`. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return NONE;
  if (seconds < 10) return `${Math.max(0, seconds).toFixed(1)} s`;
  const whole = Math.round(seconds);
  const at = UNITS.findIndex(([size]) => whole >= size);
  const [[size, unit], [minor, name] = [1, ""]] = UNITS.slice(at, at + 2);
  const rest = Math.floor((whole % size) / minor);
  const first = `${Math.floor(whole / size)} ${unit}`;
  return rest && name ? `${first} ${rest} ${name}` : first;
}

/** Write a file's size. */
export function bytes(value) {
  const power = Math.min(3, Math.max(0, Math.floor(Math.log10(value || 1) / 3)));
  return `${number(value / 1000 ** power)} ${["B", "kB", "MB", "GB"][power]}`;
}
