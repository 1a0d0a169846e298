/** Plot of the output over an input on a canvas: a loop, whose abscissas do not increase. */

import { clearCanvas, theme } from "../lib/canvas.js";
import { el } from "../lib/dom.js";
import { formatNumber, formatShort } from "../lib/numbers.js";
import { makeScale } from "../lib/scale.js";

const [HEIGHT, LEFT, TOP, RIGHT, BOTTOM] = [250, 62, 10, 12, 36];

/** Return the least and the greatest number of a list, in which null is missing; null if there is none. */
export function findLimits(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values)
    if (value !== null) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  return low <= high ? [low, high] : null;
}

/** Make the plot; `draw(x, y)` shows `{label, values}` of the input and of the output. */
export function makeLoopPlot(title, signal) {
  const canvas = el("canvas", { "aria-hidden": "true" });
  const plot = el("div", { class: "loop s0", role: "img", "aria-label": title }, canvas);
  let axes = null;

  function render() {
    const width = plot.clientWidth;
    if (!width || axes === null) return;
    const pen = clearCanvas(canvas, [width, HEIGHT]);
    const style = getComputedStyle(plot);
    const colour = (name) => style.getPropertyValue(name);
    pen.font = `11.5px ${style.fontFamily}`;
    const [x, y] = axes.map(({ limits }, at) =>
      at
        ? makeScale(limits, [HEIGHT - BOTTOM, TOP], { padding: 0.05 })
        : makeScale(limits, [LEFT, width - RIGHT], { padding: 0.05, maxTicks: width < 480 ? 5 : 8 }));
    drawAxes(pen, x, y, width, colour);
    pen.strokeStyle = colour("--series");
    pen.lineWidth = 1.3;
    pen.lineJoin = "round";
    pen.beginPath();
    let isDown = false;
    axes[0].values.forEach((value, at) => {
      const output = axes[1].values[at];
      if (output !== null) pen[isDown ? "lineTo" : "moveTo"](x.at(value), y.at(output));
      isDown = output !== null;
    });
    pen.stroke();
  }

  function drawAxes(pen, x, y, width, colour) {
    pen.fillStyle = colour("--soft");
    pen.strokeStyle = colour("--line");
    pen.lineWidth = 1;
    pen.beginPath();
    pen.textAlign = "right";
    for (const tick of y.ticks) {
      pen.moveTo(LEFT, y.at(tick));
      pen.lineTo(width - RIGHT, y.at(tick));
      pen.fillText(formatShort(tick), LEFT - 7, y.at(tick) + 4);
    }
    pen.textAlign = "center";
    for (const tick of x.ticks) {
      pen.moveTo(x.at(tick), TOP);
      pen.lineTo(x.at(tick), HEIGHT - BOTTOM + 4);
      pen.fillText(formatShort(tick), x.at(tick), HEIGHT - BOTTOM + 17);
    }
    pen.stroke();
    pen.fillText(axes[0].label, (LEFT + width - RIGHT) / 2, HEIGHT - 3);
    pen.save();
    pen.translate(12, (TOP + HEIGHT - BOTTOM) / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(axes[1].label, 0, 0);
    pen.restore();
  }

  const describe = ({ label, limits }) =>
    `${label} from ${limits.map((each) => formatNumber(each)).join(" to ")}`;
  const observer = new ResizeObserver(render);
  observer.observe(plot);
  theme.addEventListener("change", render, { signal });
  signal.addEventListener("abort", () => observer.disconnect(), { once: true });
  return {
    node: el("figure", { class: "chart" }, el("figcaption", {}, el("h3", {}, title)), plot),
    draw(input, output) {
      const found = [input, output].map((axis) => ({ ...axis, limits: findLimits(axis.values) }));
      axes = found.every(({ limits }) => limits) ? found : null;
      canvas.hidden = axes === null;
      plot.setAttribute("aria-label", axes === null ? title : `${title}: ${axes.map(describe).join(", ")}`);
      render();
    },
  };
}
