/**
 * Line charts in SVG: several series, a linear or logarithmic axis, read by eye, mouse, arrow keys or aloud.
 * Styles are classes (job.css): the service's policy allows none in the markup.
 */

import { el, say, svg } from "./dom.js";
import { number, short } from "./numbers.js";
import { scale } from "./scale.js";

const MARGIN = { left: 58, right: 12, top: 10, bottom: 36 };
const HEIGHT = 250;

/** Colours of lines in job.css; more series than these are told apart by dashes. */
export const COLOURS = 8;

/** Return at most about twice so many points: of each stretch its least and its greatest, in order. */
export function thinned(points, stretches) {
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
    let [least, most] = [numbers[0], numbers[0]];
    for (const point of numbers) {
      if (point[1] < least[1]) least = point;
      if (point[1] > most[1]) most = point;
    }
    kept.push(...(least === most ? [least] : least[0] < most[0] ? [least, most] : [most, least]));
  }
  kept.push(points.at(-1));
  return kept;
}

/** Return the point nearest to an abscissa, of points in order; undefined where there is none. */
export function nearest(points, x) {
  let [low, high] = [0, points.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (points[middle][0] <= x) low = middle;
    else high = middle;
  }
  const [left, right] = [points[low], points[high]];
  return left && Math.abs(left[0] - x) <= Math.abs(right[0] - x) ? left : right;
}

/** Write a path through points; it is broken where a value is missing. */
export function pathOf(points, x, y) {
  let path = "";
  let pen = false;
  for (const [at, value] of points) {
    if (value !== null) path += `${pen ? "L" : "M"}${x.at(at).toFixed(1)} ${y.at(value).toFixed(1)}`;
    pen = value !== null;
  }
  return path;
}

/** What cannot be drawn is missing: nothing, infinity, and on a logarithmic axis what is not above zero. */
const drawable = (log) => ([x, y]) => [x, Number.isFinite(y) && (!log || y > 0) ? y : null];

const circle = (kind, r, cx, cy) => svg("circle", { class: kind, r, cx, cy });

/**
 * Make a chart.
 *
 * `title` names it; `x` and `y` are `{label, log, whole}`; with `marks` the points are shown, too.
 * `draw(series)` takes `[{name, points: [[x, y], ...], faint}]`, the abscissas rising; faint series are a
 * background without an entry of their own in the legend.
 */
export function lineChart({ title, x: across, y: up, marks = false }) {
  const picture = svg("svg", { "aria-hidden": "true" });
  const plot = el("div", { class: "plot", tabindex: "0", role: "slider", "aria-label": title }, picture);
  const legend = el("ul", { class: "legend" });
  const place = el("p", { class: "place soft" });
  const caption = el("figcaption", {}, el("h3", {}, title), place);
  const node = el("figure", { class: "chart", hidden: true }, caption, plot, legend);
  let series = [];
  let scales = null;
  let pointed = null;

  const named = () => series.filter((each) => !each.faint);
  const axis = () => named().find((each) => each.points.length)?.points ?? [];

  function layOut(width) {
    const points = series.flatMap((each) => each.points);
    const values = points.map((point) => point[1]).filter((value) => value !== null);
    scales = {
      x: scale(points.map((point) => point[0]), [MARGIN.left, width - MARGIN.right], {
        log: across.log,
        whole: across.whole,
        most: width < 480 ? 5 : 8,
        share: marks ? 0.06 : 0,
      }),
      y: scale(values, [HEIGHT - MARGIN.bottom, MARGIN.top], { log: up.log, share: 0.05 }),
    };
  }

  function frame(width) {
    const [bottom, right] = [HEIGHT - MARGIN.bottom, width - MARGIN.right];
    const grid = scales.y.ticks.flatMap((value) => {
      const at = scales.y.at(value);
      return [
        svg("line", { class: "grid", x1: MARGIN.left, x2: right, y1: at, y2: at }),
        svg("text", { class: "tick end", x: MARGIN.left - 7, y: at + 4 }, short(value)),
      ];
    });
    const feet = scales.x.ticks.flatMap((value) => {
      const at = scales.x.at(value);
      return [
        svg("line", { class: "grid", x1: at, x2: at, y1: bottom, y2: bottom + 4 }),
        svg("text", { class: "tick middle", x: at, y: bottom + 17 }, short(value)),
      ];
    });
    const foot = svg("line", { class: "axis", x1: MARGIN.left, x2: right, y1: bottom, y2: bottom });
    const turned = `rotate(-90 12 ${(bottom + MARGIN.top) / 2})`;
    return [
      ...grid,
      ...feet,
      foot,
      svg("text", { class: "tick middle", x: (MARGIN.left + right) / 2, y: HEIGHT - 3 }, across.label),
      svg("text", { class: "tick middle", x: 12, y: (bottom + MARGIN.top) / 2, transform: turned }, up.label),
    ];
  }

  function lines(width) {
    let at = 0;
    const most = Math.max(60, Math.min(width, 60_000 / series.length));
    return series.flatMap(({ points, faint, name }) => {
      const kind = faint ? "faint" : `line s${at % COLOURS}${at >= COLOURS ? " dashed" : ""}`;
      if (!faint) at += 1;
      const d = pathOf(thinned(points, most), scales.x, scales.y);
      const seen = marks ? points.filter((point) => point[1] !== null) : [];
      const dot = ([px, py]) => circle(kind, 3.5, scales.x.at(px), scales.y.at(py));
      return [svg("path", { class: kind, "data-name": name, d }), ...seen.map(dot)];
    });
  }

  function paint() {
    const width = plot.clientWidth;
    if (!width || node.hidden) return;
    picture.setAttribute("viewBox", `0 0 ${width} ${HEIGHT}`);
    picture.setAttribute("width", width);
    picture.setAttribute("height", HEIGHT);
    layOut(width);
    picture.replaceChildren(...frame(width), ...lines(width), svg("g", { class: "pointer" }));
    point();
  }

  /** Show the values at the place that is pointed at, at first the last one: in the legend, and aloud. */
  function point() {
    const points = axis();
    if (!points.length || scales === null) return;
    const [x] = pointed === null ? points.at(-1) : nearest(points, pointed);
    const found = named().map((each) => nearest(each.points, x));
    say(place, `${across.label} ${short(x)}`);
    const values = [...legend.querySelectorAll("data")];
    found.forEach((value, at) => {
      values[at].value = value?.[1] ?? "";
      say(values[at], number(value?.[1]));
    });
    const spoken = named().map((each, at) => `${each.name} ${number(found[at]?.[1])}`);
    const text = `${across.label} ${short(x)}: ${spoken.join(", ")}`;
    const told = { min: points[0][0], max: points.at(-1)[0], now: x, text };
    for (const [name, value] of Object.entries(told)) plot.setAttribute(`aria-value${name}`, value);
    const at = scales.x.at(x);
    const rule = svg("line", { class: "rule", x1: at, x2: at, y1: MARGIN.top, y2: HEIGHT - MARGIN.bottom });
    const dots = found.flatMap((each, index) =>
      each && each[1] !== null
        ? [circle(`dot s${index % COLOURS}`, 4, at, scales.y.at(each[1]))]
        : []);
    picture.querySelector(".pointer").replaceChildren(...(pointed === null ? [] : [rule, ...dots]));
  }

  function step(event) {
    const points = axis();
    const now = points.findIndex(([x]) => x >= Number(plot.getAttribute("aria-valuenow")));
    const far = Math.max(1, Math.round(points.length / 10));
    const moves = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -far, PageUp: far };
    const ends = { Home: 0, End: points.length - 1 };
    const next = ends[event.key] ?? now + moves[event.key];
    if (!points.length || Number.isNaN(next)) return;
    event.preventDefault();
    [pointed] = points[Math.max(0, Math.min(points.length - 1, next))];
    point();
  }

  plot.addEventListener("keydown", step);
  plot.addEventListener("pointermove", (event) => {
    if (scales === null) return;
    pointed = scales.x.back(event.clientX - plot.getBoundingClientRect().left);
    point();
  });
  for (const kind of ["pointerleave", "blur"])
    plot.addEventListener(kind, () => {
      pointed = null;
      point();
    });
  new ResizeObserver(paint).observe(plot);

  function draw(given) {
    series = given.map((each) => ({ ...each, points: each.points.map(drawable(up.log)) }));
    const names = named().map((each) => each.name);
    if (names.join("\n") !== [...legend.children].map((item) => item.dataset.name).join("\n"))
      legend.replaceChildren(...names.map(entry));
    node.hidden = !series.some((each) => each.points.some((entry) => entry[1] !== null));
    paint();
  }

  return { node, draw };
}

function entry(name, at) {
  const swatch = svg("svg", { class: "swatch", width: 22, height: 10, "aria-hidden": "true" });
  const kind = `line s${at % COLOURS}${at >= COLOURS ? " dashed" : ""}`;
  swatch.append(svg("path", { class: kind, d: "M1 5H21" }));
  return el("li", { "data-name": name }, swatch, `${name} `, el("data", {}));
}
