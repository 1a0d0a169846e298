/** Drawing of a signal plot on a canvas: its panels, with marked ranges and rows behind them. */

import { clearCanvas } from "../lib/canvas.js";
import { formatShort } from "../lib/numbers.js";
import { makeScale } from "../lib/scale.js";
import { drawEnvelope, drawNames, strokeLine } from "./signal_lines.js";

/** Heights of a panel with one line, of one with several, of the space below, and of the axis of time. */
const [PANEL, TALL_PANEL, GAP, BOTTOM] = [110, 150, 14, 36];

/** Margins at the left and the right of the panels. */
export const [LEFT, RIGHT] = [62, 8];

/** Opacity of the ranges by name, and their colours. */
const RANGES = { estimation: ["accent", 0.13], validation: ["warn", 0.2] };

const COLOURS = ["ink", "soft", "line", "accent", "before", "warn", "bad"];

function drawRanges(pen, x, ranges, bottom, colours) {
  for (const [name, range] of Object.entries(ranges)) {
    if (!range) continue;
    const [colour, opacity] = RANGES[name];
    const [from, to] = range.map(x.at);
    pen.fillStyle = pen.strokeStyle = colours[colour];
    pen.globalAlpha = opacity;
    pen.fillRect(from, 0, to - from, bottom);
    pen.globalAlpha = 0.8;
    for (const edge of [from, to]) strokeLine(pen, edge, 0, edge, bottom);
  }
  pen.globalAlpha = 1;
}

function drawMarks(pen, x, marks, bottom, { bad }) {
  pen.strokeStyle = bad;
  for (const row of marks) strokeLine(pen, x.at(row), 0, x.at(row), bottom);
}

function drawTimes(pen, { range, dt, width }, height, { soft, line }) {
  pen.fillStyle = soft;
  pen.textAlign = "center";
  const limits = range.map((row) => row * (dt ?? 1));
  const times = makeScale(limits, [LEFT, width - RIGHT], { maxTicks: 8 });
  for (const tick of times.ticks) {
    pen.strokeStyle = line;
    strokeLine(pen, times.at(tick), 0, times.at(tick), height - BOTTOM);
    const text = formatShort(tick);
    // The last one is not cut off by the edge.
    pen.fillText(text, Math.min(times.at(tick), width - pen.measureText(text).width / 2), height - 21);
  }
  pen.fillText(dt === null ? "row" : "time (s)", (LEFT + width) / 2, height - 4);
}

/** Return the least and the greatest value of lines in visible parts; none if all are missing. */
function findLimits(answers, lines) {
  let [low, high] = [Infinity, -Infinity];
  for (const { columns, first, last } of answers)
    for (const { name } of lines) {
      const { minimum, maximum } = columns.get(name) ?? { minimum: [], maximum: [] };
      // A comparison with NaN, a missing value, is false.
      for (let part = first; part < last; part += 1) {
        if (minimum[part] < low) low = minimum[part];
        if (maximum[part] > high) high = maximum[part];
      }
    }
  return low <= high ? [low, high] : [];
}

function drawPanel(pen, x, { answers, width }, lines, [top, bottom], colours) {
  const values = findLimits(answers, lines);
  const y = makeScale(values, [bottom - 4, top + 20], { padding: 0.05, maxTicks: 4 });
  pen.textAlign = "right";
  pen.fillStyle = colours.soft;
  const ticks = values.length ? y.ticks : [];
  for (const tick of ticks) pen.fillText(formatShort(tick), LEFT - 6, y.at(tick) + 4);
  pen.strokeStyle = colours.line;
  strokeLine(pen, LEFT, bottom, width, bottom);
  drawNames(pen, lines, [LEFT + 4, top + 14], colours);
  pen.save();
  pen.beginPath();
  pen.rect(LEFT, top, width - LEFT, bottom - top);
  pen.clip();
  for (const { name, colour = "accent" } of lines) {
    pen.strokeStyle = colours[colour];
    drawEnvelope(pen, x, y, [LEFT, width], answers, name);
  }
  pen.restore();
}

/** Return the scale from rows to pixels of a plot. */
export const makeRowScale = (range, width) => makeScale(range, [LEFT, width - RIGHT], { maxTicks: 8 });

/** Read the colours and the font of a plot from its style. */
export const readColours = (style) => ({
  ...Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`)])),
  font: `11.5px ${style.fontFamily}`,
});

/**
 * Draw a plot. `view` has its `panels`, the `range` of rows, the sampling time `dt`, the `answers` that show
 * the range, the marked `ranges`, the rows `marks`, the `pointed` row and `width`.
 */
export function drawSignals(canvas, view, colours) {
  const { panels, range, width, pointed } = view;
  const heights = panels.map((lines) => (lines.length > 1 ? TALL_PANEL : PANEL));
  const height = heights.reduce((sum, each) => sum + each + GAP, BOTTOM);
  const pen = clearCanvas(canvas, [width, height]);
  pen.font = colours.font;
  const x = makeRowScale(range, width);
  pen.save();
  pen.beginPath();
  pen.rect(LEFT, 0, width - LEFT, height - BOTTOM);
  pen.clip();
  drawRanges(pen, x, view.ranges, height - BOTTOM, colours);
  drawMarks(pen, x, view.marks, height - BOTTOM, colours);
  pen.restore();
  drawTimes(pen, view, height, colours);
  panels.reduce((top, lines, at) => {
    drawPanel(pen, x, view, lines, [top, top + heights[at]], colours);
    return top + heights[at] + GAP;
  }, 0);
  if (pointed === null) return;
  pen.strokeStyle = colours.soft;
  pen.setLineDash([3, 3]);
  strokeLine(pen, x.at(pointed), 0, x.at(pointed), height - BOTTOM);
}
