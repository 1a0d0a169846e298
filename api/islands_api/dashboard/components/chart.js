/**
 * Line charts in SVG with several series and linear or logarithmic axes.
 * Values are read with the mouse, the arrow keys or a screen reader. Styles are classes (job.css): the
 * content security policy of the service forbids inline styles.
 */

import { el, setText, svg } from "../lib/dom.js";
import { formatInterval, formatNumber, formatShort } from "../lib/numbers.js";
import { makeScale } from "../lib/scale.js";

const MARGIN = { right: 12, top: 10, bottom: 36 };

/** Smallest left margin, and widths of its space without tick labels and of a character. */
const LEFT = { least: 58, space: 31, character: 6.8 };
const HEIGHT = 250;

/** Distance of points in pixels below which they are small, and their line is thin. */
const DENSE_PIXELS = 6;

/** Stretches of all faint lines together: a running search draws its lines again after each event. */
const FAINT_STRETCHES = 1000;

/** Number of line colours in job.css; further series are dashed. */
export const COLOURS = 8;

/** Downsample points: keep the lowest and the highest point of each of `stretches` sections, in order. */
export function downsample(points, stretches) {
  if (points.length <= 2 * stretches) return points;
  const kept = [points[0]];
  const size = (points.length - 2) / stretches;
  for (let stretch = 0; stretch < stretches; stretch += 1) {
    const part = points.slice(1 + Math.round(stretch * size), 1 + Math.round((stretch + 1) * size));
    const numbers = part.filter(([, y]) => y !== null);
    if (numbers.length === 0) {
      kept.push(...part.slice(0, 1));
      continue;
    }
    let [lowest, highest] = [numbers[0], numbers[0]];
    for (const point of numbers) {
      if (point[1] < lowest[1]) lowest = point;
      if (point[1] > highest[1]) highest = point;
    }
    const pair = lowest[0] < highest[0] ? [lowest, highest] : [highest, lowest];
    kept.push(...(lowest === highest ? [lowest] : pair));
  }
  kept.push(points.at(-1));
  return kept;
}

/** Return the point nearest to an abscissa; the points are sorted. Undefined if there are no points. */
export function findNearest(points, x) {
  let [low, high] = [0, points.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (points[middle][0] <= x) low = middle;
    else high = middle;
  }
  const [left, right] = [points[low], points[high]];
  return left && Math.abs(left[0] - x) <= Math.abs(right[0] - x) ? left : right;
}

/** Make the path data of a line through points, interrupted at missing values. */
export function makePath(points, x, y) {
  let path = "";
  let pen = false;
  for (const [at, value] of points) {
    if (value !== null) path += `${pen ? "L" : "M"}${x.at(at).toFixed(1)} ${y.at(value).toFixed(1)}`;
    pen = value !== null;
  }
  return path;
}

/** Replace values that cannot be drawn by null: NaN, infinity, and on a logarithmic axis zero and below. */
const maskUndrawable = (log) => ([x, y, half]) =>
  [x, Number.isFinite(y) && (!log || y > 0) ? y : null, half];

/** Format the ordinate of a point, with its interval if it has one. */
const formatPoint = ([, y, half] = []) =>
  half === undefined ? formatNumber(y) : formatInterval(y, half);

/** Return the least and the greatest ordinate of a series with its intervals; none if all are missing. */
function getExtremes({ points }) {
  let [low, high] = [Infinity, -Infinity];
  for (const [, y, half = 0] of points)
    if (y !== null) {
      if (y - half < low) low = y - half;
      if (y + half > high) high = y + half;
    }
  return low <= high ? [low, high] : [];
}

const circle = (kind, r, cx, cy) => svg("circle", { class: kind, r, cx, cy });

/**
 * Make a chart.
 *
 * `title` is its heading; `x` and `y` are `{label, log, integer}`; with `marks`, points are drawn as circles.
 * `x.describe(at)` replaces the label and number of an abscissa in texts.
 * `draw(series, events)` takes `[{name, points: [[x, y, half], ...], faint, bare}]`, abscissas increasing.
 * `half` is half the length of the interval of a point, if it has one and the axis is linear. Faint series
 * form the background and have no entry in the legend; bare ones have no circles. Events are vertical lines
 * `{kind, at}` over the series and bands `{kind, from, to}` behind them.
 */
export function makeLineChart({ title, x: xAxis, y: yAxis, marks = false }) {
  const describe = xAxis.describe ?? ((at) => `${xAxis.label} ${formatShort(at)}`);
  const drawing = svg("svg", { "aria-hidden": "true" });
  const plot = el("div", { class: "plot", tabindex: "0", role: "slider", "aria-label": title }, drawing);
  const legend = el("ul", { class: "legend" });
  const position = el("p", { class: "position soft" });
  const caption = el("figcaption", {}, el("h3", {}, title), position);
  const node = el("figure", { class: "chart", hidden: true }, caption, plot, legend);
  let [series, events] = [[], []];
  let scales = null;
  let pointedX = null;

  const getNamedSeries = () => series.filter((each) => !each.faint);
  const getPoints = () => getNamedSeries().find((each) => each.points.length)?.points ?? [];

  function updateScales(width) {
    const heights = [HEIGHT - MARGIN.bottom, MARGIN.top];
    const y = makeScale(series.flatMap(getExtremes), heights, { log: yAxis.log, padding: 0.05 });
    const longest = Math.max(0, ...y.ticks.map((value) => formatShort(value).length));
    const left = Math.max(LEFT.least, LEFT.space + LEFT.character * longest);
    // Abscissas increase.
    const ends = series.flatMap(({ points }) => (points.length ? [points[0][0], points.at(-1)[0]] : []));
    const x = makeScale(ends, [left, width - MARGIN.right], {
      log: xAxis.log,
      integer: xAxis.integer,
      maxTicks: width < 480 ? 5 : 8,
      padding: marks ? 0.06 : 0,
    });
    scales = { x, y, left };
  }

  function makeAxes(width) {
    const [bottom, right, { left }] = [HEIGHT - MARGIN.bottom, width - MARGIN.right, scales];
    const grid = scales.y.ticks.flatMap((value) => {
      const at = scales.y.at(value);
      return [
        svg("line", { class: "grid", x1: left, x2: right, y1: at, y2: at }),
        svg("text", { class: "tick end", x: left - 7, y: at + 4 }, formatShort(value)),
      ];
    });
    const xTicks = scales.x.ticks.flatMap((value) => {
      const at = scales.x.at(value);
      return [
        svg("line", { class: "grid", x1: at, x2: at, y1: bottom, y2: bottom + 4 }),
        svg("text", { class: "tick middle", x: at, y: bottom + 17 }, formatShort(value)),
      ];
    });
    const xLine = svg("line", { class: "axis", x1: left, x2: right, y1: bottom, y2: bottom });
    const rotation = `rotate(-90 12 ${(bottom + MARGIN.top) / 2})`;
    return [
      ...grid,
      ...xTicks,
      xLine,
      svg("text", { class: "tick middle", x: (left + right) / 2, y: HEIGHT - 3 }, xAxis.label),
      svg(
        "text",
        { class: "tick middle", x: 12, y: (bottom + MARGIN.top) / 2, transform: rotation },
        yAxis.label,
      ),
    ];
  }

  function makeEvent({ kind, at, from = at, to = at }) {
    const [left, right] = [scales.x.at(from), scales.x.at(to)];
    const [y, height] = [MARGIN.top, HEIGHT - MARGIN.bottom - MARGIN.top];
    // A band of a single abscissa would be invisible.
    return at === undefined
      ? svg("rect", { class: kind, x: left - 3, width: right - left + 6, y, height })
      : svg("line", { class: kind, x1: left, x2: left, y1: y, y2: y + height });
  }

  function makeInterval(kind, [at, y, half]) {
    const x = scales.x.at(at);
    return svg("line", { class: kind, x1: x, x2: x, y1: scales.y.at(y - half), y2: scales.y.at(y + half) });
  }

  function makeLines(width) {
    let at = 0;
    // Two points of each stretch are kept: one for each pixel, and fewer of many faint lines.
    const stretches = width / 2;
    const faintStretches = Math.max(60, Math.min(stretches, FAINT_STRETCHES / series.length));
    return series.flatMap(({ points, faint, name, bare }) => {
      const shown = downsample(points, faint ? faintStretches : stretches);
      const isDense = marks && !bare && shown.length > width / DENSE_PIXELS;
      const style = `${at >= COLOURS ? " dashed" : ""}${isDense ? " dense" : ""}`;
      const kind = faint ? "faint" : `line s${at % COLOURS}${style}`;
      if (!faint) at += 1;
      const d = makePath(shown, scales.x, scales.y);
      const known = shown.filter((point) => point[1] !== null);
      const dot = ([px, py]) => circle(kind, isDense ? 1.5 : 3.5, scales.x.at(px), scales.y.at(py));
      return [
        ...known.filter(([, , half]) => half).map((point) => makeInterval(`${kind} interval`, point)),
        svg("path", { class: kind, "data-name": name, d }),
        ...(marks && !bare ? known.map(dot) : []),
      ];
    });
  }

  function render() {
    const width = plot.clientWidth;
    if (!width || node.hidden) return;
    drawing.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
    drawing.setAttribute("width", width);
    drawing.setAttribute("height", HEIGHT);
    updateScales(width);
    drawing.replaceChildren(
      ...events.filter(({ at }) => at === undefined).map(makeEvent),
      ...makeAxes(width),
      ...makeLines(width),
      ...events.filter(({ at }) => at !== undefined).map(makeEvent),
      svg("g", { class: "pointer" }),
    );
    updatePointer();
  }

  /** Show the values at the pointer (initially the last ones) in the legend and to screen readers. */
  function updatePointer() {
    const points = getPoints();
    if (!points.length || scales === null) return;
    const [x] = pointedX === null ? points.at(-1) : findNearest(points, pointedX);
    const found = getNamedSeries().map((each) => findNearest(each.points, x));
    setText(position, describe(x));
    const values = [...legend.querySelectorAll("data")];
    found.forEach((value, at) => {
      values[at].value = value?.[1] ?? "";
      setText(values[at], formatPoint(value));
    });
    const texts = getNamedSeries().map((each, at) => `${each.name} ${formatPoint(found[at])}`);
    const text = `${describe(x)}: ${texts.join(", ")}`;
    const aria = { min: points[0][0], max: points.at(-1)[0], now: x, text };
    for (const [name, value] of Object.entries(aria)) plot.setAttribute(`aria-value${name}`, value);
    const at = scales.x.at(x);
    const rule = svg("line", { class: "rule", x1: at, x2: at, y1: MARGIN.top, y2: HEIGHT - MARGIN.bottom });
    const dots = found.flatMap((each, index) =>
      each && each[1] !== null
        ? [circle(`dot s${index % COLOURS}`, 4, at, scales.y.at(each[1]))]
        : []);
    drawing.querySelector(".pointer").replaceChildren(...(pointedX === null ? [] : [rule, ...dots]));
  }

  function handleKey(event) {
    const points = getPoints();
    const now = points.findIndex(([x]) => x >= Number(plot.getAttribute("aria-valuenow")));
    const page = Math.max(1, Math.round(points.length / 10));
    const moves = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -page, PageUp: page };
    const ends = { Home: 0, End: points.length - 1 };
    const next = ends[event.key] ?? now + moves[event.key];
    if (!points.length || Number.isNaN(next)) return;
    event.preventDefault();
    [pointedX] = points[Math.max(0, Math.min(points.length - 1, next))];
    updatePointer();
  }

  plot.addEventListener("keydown", handleKey);
  plot.addEventListener("pointermove", (event) => {
    if (scales === null) return;
    pointedX = scales.x.back(event.clientX - plot.getBoundingClientRect().left);
    updatePointer();
  });
  for (const kind of ["pointerleave", "blur"])
    plot.addEventListener(kind, () => {
      pointedX = null;
      updatePointer();
    });
  new ResizeObserver(render).observe(plot);

  function draw(newSeries, newEvents = []) {
    events = newEvents;
    series = newSeries.map((each) => ({ ...each, points: each.points.map(maskUndrawable(yAxis.log)) }));
    const names = getNamedSeries().map((each) => each.name);
    if (names.join("\n") !== [...legend.children].map((item) => item.dataset.name).join("\n"))
      legend.replaceChildren(...names.map(makeLegendEntry));
    node.hidden = !series.some((each) => each.points.some((point) => point[1] !== null));
    render();
  }

  return { node, draw };
}

function makeLegendEntry(name, at) {
  const swatch = svg("svg", { class: "swatch", width: 22, height: 10, "aria-hidden": "true" });
  const kind = `line s${at % COLOURS}${at >= COLOURS ? " dashed" : ""}`;
  swatch.append(svg("path", { class: kind, d: "M1 5H21" }));
  return el("li", { "data-name": name }, swatch, `${name} `, el("data", {}));
}
