/** Drawing of a line chart on a canvas: bands, axes, lines with intervals and marks, and the pointer. */

import { applyStyle, clearCanvas, getStyle } from "../lib/canvas.js";
import { formatShort } from "../lib/numbers.js";
import { makeScale } from "../lib/scale.js";

export const HEIGHT = 250;

const MARGIN = { right: 12, top: 10, bottom: 36 };
const BOTTOM = HEIGHT - MARGIN.bottom;

/** Smallest left margin, and widths of its space without tick labels and of a character. */
const LEFT = { least: 58, space: 31, character: 6.8 };

/** Distance of points in pixels below which they are small, and their line is thin. */
const DENSE_PIXELS = 6;

/** Stretches of all faint lines together: a running search draws its lines again after each event. */
const FAINT_STRETCHES = 1000;

/** Number of line colours in job.css; further series are dashed. */
export const COLOURS = 8;

/** Return the classes of the line of a series by its place among those in the legend. */
export const getLineClass = (at) => `line s${at % COLOURS}${at >= COLOURS ? " dashed" : ""}`;

/**
 * Downsample a series: return the places of the lowest and of the highest ordinate of each of `stretches`
 * sections, and of both ends, in order. A section without numbers is one gap.
 */
export function downsample(y, stretches) {
  const last = y.length - 1;
  if (y.length <= 2 * stretches) return Array.from(y, (_, at) => at);
  const kept = [0];
  const size = (last - 1) / stretches;
  for (let stretch = 0; stretch < stretches; stretch += 1) {
    const from = 1 + Math.round(stretch * size);
    const to = 1 + Math.round((stretch + 1) * size);
    let [lowest, highest] = [-1, -1];
    for (let at = from; at < to; at += 1) {
      if (Number.isNaN(y[at])) continue;
      if (lowest < 0 || y[at] < y[lowest]) lowest = at;
      if (highest < 0 || y[at] > y[highest]) highest = at;
    }
    if (lowest < 0) kept.push(from);
    else if (lowest === highest) kept.push(lowest);
    else kept.push(Math.min(lowest, highest), Math.max(lowest, highest));
  }
  kept.push(last);
  return kept;
}

/** Return the least and the greatest ordinate of a series with its intervals; none if all are missing. */
function getExtremes({ y, half }) {
  let [low, high] = [Infinity, -Infinity];
  for (let at = 0; at < y.length; at += 1) {
    const length = half ? half[at] : 0;
    // A comparison with NaN, a missing value, is false.
    if (y[at] - length < low) low = y[at] - length;
    if (y[at] + length > high) high = y[at] + length;
  }
  return low <= high ? [low, high] : [];
}

/** Make the scales of a chart of a width: `{x, y, left}`. Abscissas increase. */
export function makeScales({ series, axes, marks }, width) {
  const y = makeScale(series.flatMap(getExtremes), [BOTTOM, MARGIN.top], { log: axes.y.log, padding: 0.05 });
  const longest = Math.max(0, ...y.ticks.map((value) => formatShort(value).length));
  const left = Math.max(LEFT.least, LEFT.space + LEFT.character * longest);
  const ends = series.flatMap((each) => (each.x.length ? [each.x[0], each.x[each.x.length - 1]] : []));
  const x = makeScale(ends, [left, width - MARGIN.right], {
    log: axes.x.log,
    integer: axes.x.integer,
    maxTicks: width < 480 ? 5 : 8,
    padding: marks ? 0.06 : 0,
  });
  return { x, y, left };
}

function strokeLines(pen, classes, lines) {
  applyStyle(pen, getStyle("line", classes));
  pen.beginPath();
  for (const [fromX, fromY, toX, toY] of lines) {
    pen.moveTo(fromX, fromY);
    pen.lineTo(toX, toY);
  }
  pen.stroke();
}

/** Draw a band behind the lines. A band of a single abscissa would be invisible. */
function drawBand(pen, { x }, { kind, from, to }) {
  const [left, right] = [x.at(from), x.at(to)];
  applyStyle(pen, getStyle("rect", kind));
  pen.fillRect(left - 3, MARGIN.top, right - left + 6, BOTTOM - MARGIN.top);
}

function drawAxes(pen, { x, y, left }, axes, width) {
  const right = width - MARGIN.right;
  strokeLines(pen, "grid", [
    ...y.ticks.map((value) => [left, y.at(value), right, y.at(value)]),
    ...x.ticks.map((value) => [x.at(value), BOTTOM, x.at(value), BOTTOM + 4]),
  ]);
  strokeLines(pen, "axis", [[left, BOTTOM, right, BOTTOM]]);
  const style = getStyle("text", "tick");
  applyStyle(pen, style);
  pen.font = style.font;
  pen.textAlign = "end";
  for (const value of y.ticks) pen.fillText(formatShort(value), left - 7, y.at(value) + 4);
  pen.textAlign = "center";
  for (const value of x.ticks) pen.fillText(formatShort(value), x.at(value), BOTTOM + 17);
  pen.fillText(axes.x.label, (left + right) / 2, HEIGHT - 3);
  pen.save();
  pen.translate(12, (BOTTOM + MARGIN.top) / 2);
  pen.rotate(-Math.PI / 2);
  pen.fillText(axes.y.label, 0, 0);
  pen.restore();
}

function drawCircle(pen, radius, atX, atY) {
  pen.beginPath();
  pen.arc(atX, atY, radius, 0, 2 * Math.PI);
  pen.fill();
  pen.stroke();
}

/** Draw a line through points at some places, interrupted at missing values. */
function drawLine(pen, { x, y }, series, places) {
  pen.beginPath();
  let isDown = false;
  for (const at of places) {
    const value = series.y[at];
    const isMissing = Number.isNaN(value);
    if (!isMissing) pen[isDown ? "lineTo" : "moveTo"](x.at(series.x[at]), y.at(value));
    isDown = !isMissing;
  }
  pen.stroke();
}

function drawSeries(pen, scales, { series, marks }, width) {
  const { x, y } = scales;
  // Two points of each stretch are kept: one for each pixel, and fewer of many faint lines.
  const stretches = width / 2;
  const faintStretches = Math.max(60, Math.min(stretches, FAINT_STRETCHES / series.length));
  let named = 0;
  for (const each of series) {
    const places = downsample(each.y, Math.floor(each.faint ? faintStretches : stretches));
    const isMarked = marks && !each.bare;
    const isDense = isMarked && places.length > width / DENSE_PIXELS;
    const kind = each.faint ? "faint" : `${getLineClass(named)}${isDense ? " dense" : ""}`;
    if (!each.faint) named += 1;
    const known = places.filter((at) => !Number.isNaN(each.y[at]));
    if (each.half) {
      const intervals = known.filter((at) => each.half[at]).map((at) => {
        const [middle, half] = [each.y[at], each.half[at]];
        return [x.at(each.x[at]), y.at(middle - half), x.at(each.x[at]), y.at(middle + half)];
      });
      strokeLines(pen, `${kind} interval`, intervals);
    }
    applyStyle(pen, getStyle("path", kind));
    drawLine(pen, scales, each, places);
    if (!isMarked) continue;
    applyStyle(pen, getStyle("circle", kind));
    for (const at of known) drawCircle(pen, isDense ? 1.5 : 3.5, x.at(each.x[at]), y.at(each.y[at]));
  }
}

/** Draw the pointer: a line, and a circle at the ordinate of each series, if it has one. */
function drawPointer(pen, { x, y }, { at, ordinates }) {
  strokeLines(pen, "rule", [[x.at(at), MARGIN.top, x.at(at), BOTTOM]]);
  ordinates.forEach((value, place) => {
    if (Number.isNaN(value)) return;
    applyStyle(pen, getStyle("circle", `dot s${place % COLOURS}`));
    drawCircle(pen, 4, x.at(at), y.at(value));
  });
}

/**
 * Draw a chart on a canvas. `view` has its `series`, `events`, `axes` and `marks`, and the `pointer`
 * `{at, ordinates}` or null.
 */
export function drawChart(canvas, view, scales, width) {
  const pen = clearCanvas(canvas, [width, HEIGHT]);
  for (const event of view.events) if (event.at === undefined) drawBand(pen, scales, event);
  drawAxes(pen, scales, view.axes, width);
  drawSeries(pen, scales, view, width);
  for (const { kind, at } of view.events)
    if (at !== undefined) strokeLines(pen, kind, [[scales.x.at(at), MARGIN.top, scales.x.at(at), BOTTOM]]);
  if (view.pointer) drawPointer(pen, scales, view.pointer);
}
