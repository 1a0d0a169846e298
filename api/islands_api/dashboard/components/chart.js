/**
 * Line charts on a canvas with several series and linear or logarithmic axes.
 * Values are read with the mouse, the arrow keys or a screen reader. Styles are classes (job.css).
 *
 * All changes before a frame of the screen are one drawing, which reads nothing that needs a new layout.
 */

import { theme } from "../lib/canvas.js";
import { limitRate } from "../lib/clock.js";
import { el, setText, svg } from "../lib/dom.js";
import { formatInterval, formatNumber, formatShort } from "../lib/numbers.js";
import { COLOURS, drawChart, getLineClass, makeScales } from "./chart_drawing.js";

export { COLOURS };

/** Return the place of the abscissa nearest to a value; abscissas increase. -1 if there are none. */
export function findNearest(abscissas, x) {
  let [low, high] = [0, abscissas.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (abscissas[middle] <= x) low = middle;
    else high = middle;
  }
  return high >= 0 && Math.abs(abscissas[low] - x) <= Math.abs(abscissas[high] - x) ? low : high;
}

/** Return values with NaN for those that cannot be drawn: null, infinity, and on a logarithmic axis <= 0. */
function maskUndrawable(values, log) {
  const masked = new Float64Array(values.length).fill(NaN);
  for (let at = 0; at < values.length; at += 1)
    if (Number.isFinite(values[at]) && (!log || values[at] > 0)) masked[at] = values[at];
  return masked;
}

/** Format the ordinate at a place of a series, with its interval if it has one. */
const formatOrdinate = ({ y, half }, at) =>
  half?.[at] === undefined ? formatNumber(y[at]) : formatInterval(y[at], half[at]);

/**
 * Make a chart, until the signal aborts.
 *
 * `title` is its heading; `x` and `y` are `{label, log, integer}`; with `marks`, points are drawn as circles.
 * `x.describe(at)` replaces the label and number of an abscissa in texts.
 * `draw(series, events)` takes `[{name, x, y, half, faint, bare}]`: lists of abscissas, which increase, and
 * of ordinates, of which null and NaN are missing. `half` are half the lengths of the intervals of points, if
 * they have any and the axis is linear. Faint series form the background and have no entry in the legend;
 * bare ones have no circles. Events are vertical lines `{kind, at}` over the series and bands
 * `{kind, from, to}` behind them.
 */
export function makeLineChart({ title, x, y, marks = false }, signal) {
  const axes = { x, y };
  const describe = x.describe ?? ((at) => `${x.label} ${formatShort(at)}`);
  const canvas = el("canvas", { "aria-hidden": "true" });
  const plot = el("div", { class: "plot", tabindex: "0", role: "slider", "aria-label": title }, canvas);
  const legend = el("ul", { class: "legend" });
  const position = el("p", { class: "position soft" });
  const caption = el("figcaption", {}, el("h3", {}, title), position);
  const node = el("figure", { class: "chart", hidden: true }, caption, plot, legend);
  let [series, named, events, entries] = [[], [], [], []];
  let [scales, pointedX, width, frame] = [null, null, 0, 0];

  const getAbscissas = () => named.find((each) => each.x.length)?.x ?? [];

  /** Return the abscissa that is read, initially the last one, and the place in each series next to it. */
  function findRead() {
    const all = getAbscissas();
    const at = all[pointedX === null ? all.length - 1 : findNearest(all, pointedX)];
    return { at, places: named.map((each) => findNearest(each.x, at)) };
  }

  /** Draw in the next frame of the screen. */
  function drawSoon() {
    frame ||= requestAnimationFrame(drawNow);
  }

  function drawNow() {
    cancelAnimationFrame(frame);
    frame = 0;
    if (!width || node.hidden) return;
    scales = makeScales({ series, axes, marks }, width);
    const { at, places } = findRead();
    const ordinates = named.map((each, place) => each.y[places[place]] ?? NaN);
    const pointer = pointedX === null || at === undefined ? null : { at, ordinates };
    drawChart(canvas, { series, events, axes, marks, pointer }, scales, width);
  }

  /** Show the values that are read in the legend and to screen readers. */
  function showValues() {
    const all = getAbscissas();
    const { at, places } = findRead();
    if (at === undefined) return;
    const texts = named.map((each, place) => formatOrdinate(each, places[place]));
    setText(position, describe(at));
    named.forEach((each, place) => {
      const value = each.y[places[place]];
      entries[place].value = Number.isFinite(value) ? value : "";
      setText(entries[place], texts[place]);
    });
    const text = `${describe(at)}: ${named.map(({ name }, place) => `${name} ${texts[place]}`).join(", ")}`;
    const aria = { min: all[0], max: all[all.length - 1], now: at, text };
    for (const [name, value] of Object.entries(aria)) plot.setAttribute(`aria-value${name}`, value);
  }

  const showValuesSoon = limitRate(showValues, signal);

  /** Read the values at an abscissa; the last ones for null. */
  function point(at) {
    pointedX = at;
    showValues();
    drawSoon();
  }

  function handleKey(event) {
    const all = getAbscissas();
    const now = all.findIndex((each) => each >= Number(plot.getAttribute("aria-valuenow")));
    const page = Math.max(1, Math.round(all.length / 10));
    const moves = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -page, PageUp: page };
    const ends = { Home: 0, End: all.length - 1 };
    const next = ends[event.key] ?? now + moves[event.key];
    if (!all.length || Number.isNaN(next)) return;
    event.preventDefault();
    point(all[Math.max(0, Math.min(all.length - 1, next))]);
  }

  plot.addEventListener("keydown", handleKey);
  plot.addEventListener("pointermove", (event) => {
    if (scales !== null) point(scales.x.back(event.clientX - plot.getBoundingClientRect().left));
  });
  for (const kind of ["pointerleave", "blur"]) plot.addEventListener(kind, () => point(null));
  const observer = new ResizeObserver(([{ contentRect }]) => {
    width = contentRect.width;
    // The frame that is being made has the new size.
    drawNow();
  });
  observer.observe(plot);
  theme.addEventListener("change", drawSoon, { signal });
  signal.addEventListener("abort", () => observer.disconnect(), { once: true });

  function draw(newSeries, newEvents = []) {
    events = newEvents;
    series = newSeries.map((each) => ({ ...each, y: maskUndrawable(each.y, y.log) }));
    const known = named.map(({ name }) => name).join("\n");
    named = series.filter((each) => !each.faint);
    if (known !== named.map(({ name }) => name).join("\n")) {
      entries = named.map(() => el("data"));
      legend.replaceChildren(...named.map(({ name }, at) => makeLegendEntry(name, at, entries[at])));
    }
    node.hidden = !series.some((each) => each.y.some(Number.isFinite));
    showValuesSoon();
    drawSoon();
  }

  return { node, draw };
}

function makeLegendEntry(name, at, value) {
  const swatch = svg("svg", { class: "swatch", width: 22, height: 10, "aria-hidden": "true" });
  swatch.append(svg("path", { class: getLineClass(at), d: "M1 5H21" }));
  return el("li", { "data-name": name }, swatch, `${name} `, value);
}
