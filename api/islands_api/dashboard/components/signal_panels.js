/** Drawing of a signal plot on a canvas: its panels, with marked ranges and rows behind them. */

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

function drawPanel(pen, x, { answer, width }, lines, [top, bottom], colours) {
  const columns = lines.map(({ name }) => answer?.columns.find((each) => each.name === name));
  const values = columns
    .flatMap((column) => (column ? [...column.minimum, ...column.maximum] : []))
    .filter((value) => value !== null);
  const y = makeScale(values, [bottom - 4, top + 20], { padding: 0.05, maxTicks: 4 });
  pen.textAlign = "right";
  pen.fillStyle = colours.soft;
  const ticks = values.length ? y.ticks : [];
  for (const tick of ticks) pen.fillText(formatShort(tick), LEFT - 6, y.at(tick) + 4);
  pen.strokeStyle = colours.line;
  strokeLine(pen, LEFT, bottom, width, bottom);
  drawNames(pen, lines, [LEFT + 4, top + 11], colours);
  pen.save();
  pen.beginPath();
  pen.rect(LEFT, top, width - LEFT, bottom - top);
  pen.clip();
  columns.forEach((column, at) => {
    pen.strokeStyle = colours[lines[at].colour ?? "accent"];
    if (column) drawEnvelope(pen, x, y, column, answer.rows);
  });
  pen.restore();
}

/** Return the scale from rows to pixels of a plot. */
export const makeRowScale = (range, width) => makeScale(range, [LEFT, width - RIGHT], { maxTicks: 8 });

/**
 * Draw a plot. `view` has its `panels`, the `range` of rows, the sampling time `dt`, the `answer` of the
 * service, the marked `ranges`, the rows `marks`, the `pointed` row and `width`.
 */
export function drawSignals(canvas, view, style) {
  const { panels, range, width, pointed } = view;
  const heights = panels.map((lines) => (lines.length > 1 ? TALL_PANEL : PANEL));
  const height = heights.reduce((sum, each) => sum + each + GAP, BOTTOM);
  const ratio = devicePixelRatio || 1;
  [canvas.width, canvas.height] = [width * ratio, height * ratio];
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  const colours = Object.fromEntries(COLOURS.map((name) => [name, style.getPropertyValue(`--${name}`)]));
  pen.font = `11.5px ${style.fontFamily}`;
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
