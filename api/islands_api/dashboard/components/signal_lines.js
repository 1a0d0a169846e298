/** Lines of a plot of signals on a canvas, and their names. */

import { labelQuantity } from "../lib/numbers.js";

/** Write the names of the lines of a panel, each in its colour if there are several, and their unit. */
export function drawNames(pen, lines, [left, base], colours) {
  pen.textAlign = "left";
  const texts = lines.map(({ name, colour }) => [name, lines.length > 1 ? colour : "ink"]);
  const last = texts[texts.length - 1];
  last[0] = labelQuantity(last[0], lines[0].unit);
  let at = left;
  for (const [text, colour] of texts) {
    pen.fillStyle = colours[colour];
    pen.fillText(text, at, base);
    at += pen.measureText(text).width + (lines.length > 1 ? 14 : 4);
  }
}

/** Thickness of a line, and pixels of a part below which a line is drawn as bars of a pixel each. */
const [THICKNESS, BAR_PIXELS] = [1.3, 4];

/** Call `visit(x, y, isStart)` for the points of a line through the extremes of visible parts, in pixels. */
function visitPoints(x, y, answers, name, visit) {
  let isDown = false;
  for (const { rows, columns, first, last } of answers) {
    const { minimum, maximum } = columns.get(name) ?? {};
    if (!minimum) continue;
    for (let part = first; part < last; part += 1) {
      const isMissing = Number.isNaN(minimum[part]);
      if (!isMissing) {
        const at = x.at(rows[part]);
        // The line enters a part at one extreme and leaves it at the other.
        const [enters, leaves] = part % 2 ? [maximum, minimum] : [minimum, maximum];
        visit(at, y.at(enters[part]), !isDown);
        visit(at, y.at(leaves[part]), false);
      }
      isDown = !isMissing;
    }
  }
}

/** Draw a line as one bar for each column of pixels: to stroke thousands of steep lines takes too long. */
function drawBars(pen, [left, right], visitAll) {
  const width = Math.ceil(right) - Math.floor(left);
  const [low, high] = [new Float32Array(width).fill(Infinity), new Float32Array(width).fill(-Infinity)];
  const add = (column, y) => {
    if (y < low[column]) low[column] = y;
    if (y > high[column]) high[column] = y;
  };
  let [fromX, fromY] = [0, 0];
  visitAll((atX, atY, isStart) => {
    const at = atX - left;
    const slope = isStart || at === fromX ? 0 : (atY - fromY) / (at - fromX);
    const end = Math.min(width - 1, Math.floor(at));
    // Where the line crosses the edge of a column it is in both.
    if (!isStart)
      for (let edge = Math.max(0, Math.floor(fromX)) + 1; edge <= end; edge += 1) {
        const crossing = fromY + slope * (edge - fromX);
        add(edge - 1, crossing);
        add(edge, crossing);
      }
    if (at >= 0 && at < width) add(end, atY);
    [fromX, fromY] = [at, atY];
  });
  pen.fillStyle = pen.strokeStyle;
  for (let column = 0; column < width; column += 1)
    if (low[column] <= high[column])
      pen.fillRect(left + column, low[column] - THICKNESS / 2, 1, high[column] - low[column] + THICKNESS);
}

/** Draw the least and the greatest values of the parts of a signal as one line between two abscissas. */
export function drawEnvelope(pen, x, y, [left, right], answers, name) {
  const parts = answers.reduce((sum, { first, last }) => sum + last - first, 0);
  const visitAll = (visit) => visitPoints(x, y, answers, name, visit);
  if (parts * BAR_PIXELS > right - left) {
    drawBars(pen, [left, right], visitAll);
    return;
  }
  pen.lineWidth = THICKNESS;
  pen.beginPath();
  visitAll((atX, atY, isStart) => pen[isStart ? "moveTo" : "lineTo"](atX, atY));
  pen.stroke();
}

/** Draw a thin line. */
export function strokeLine(pen, fromX, fromY, toX, toY) {
  pen.lineWidth = 1;
  pen.beginPath();
  pen.moveTo(fromX, fromY);
  pen.lineTo(toX, toY);
  pen.stroke();
}
