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

/** Draw the least and the greatest values of the parts of a signal as one line. */
export function drawEnvelope(pen, x, y, { minimum, maximum }, rows) {
  pen.lineWidth = 1.3;
  pen.beginPath();
  let isDown = false;
  rows.forEach((row, part) => {
    const [low, high] = [minimum[part], maximum[part]];
    if (low === null) isDown = false;
    else {
      // The line enters a part at one extreme and leaves it at the other.
      const [first, second] = part % 2 ? [high, low] : [low, high];
      pen[isDown ? "lineTo" : "moveTo"](x.at(row), y.at(first));
      pen.lineTo(x.at(row), y.at(second));
      isDown = true;
    }
  });
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
