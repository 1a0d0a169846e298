/** Canvases: their pens, and the styles of classes, which are read once for each theme. */

import { svg } from "./dom.js";

/** Sends `change` when the colours of the page or the pixels of the screen change. */
export const theme = new EventTarget();

const styles = new Map();
const probes = svg("svg", { class: "probes", "aria-hidden": "true", hidden: true });

function forgetStyles() {
  styles.clear();
  theme.dispatchEvent(new Event("change"));
}

for (const query of ["(prefers-color-scheme: dark)", "(forced-colors: active)"])
  matchMedia(query).addEventListener("change", forgetStyles);

/** Notice that the page is zoomed, or moved to another screen: the query holds for one resolution only. */
function watchResolution() {
  const changed = () => {
    watchResolution();
    forgetStyles();
  };
  matchMedia(`(resolution: ${devicePixelRatio}dppx)`).addEventListener("change", changed, { once: true });
}

watchResolution();

/** Return what the style sheets say about an SVG element with classes. */
export function getStyle(name, classes) {
  const key = `${name} ${classes}`;
  if (!styles.has(key)) {
    if (!probes.isConnected) document.body.append(probes);
    const probe = svg(name, { class: classes });
    probes.replaceChildren(probe);
    const found = getComputedStyle(probe);
    const dash = found.strokeDasharray;
    styles.set(key, {
      stroke: found.stroke,
      fill: found.fill,
      width: parseFloat(found.strokeWidth),
      dash: dash === "none" ? [] : dash.split(",").map(parseFloat),
      join: found.strokeLinejoin,
      opacity: Number(found.opacity),
      font: `${found.fontSize} ${found.fontFamily}`,
    });
    probes.replaceChildren();
  }
  return styles.get(key);
}

/** Let a pen stroke and fill in a style. */
export function applyStyle(pen, { stroke, fill, width, dash, join, opacity }) {
  // A pen ignores the colour `none`.
  pen.strokeStyle = stroke === "none" ? "transparent" : stroke;
  pen.fillStyle = fill === "none" ? "transparent" : fill;
  pen.lineWidth = width;
  pen.setLineDash(dash);
  pen.lineJoin = join;
  pen.globalAlpha = opacity;
}

/** Return the pen of a canvas of a size in pixels of the page, which is empty. */
export function clearCanvas(canvas, size) {
  const ratio = devicePixelRatio || 1;
  const [width, height] = size.map((each) => Math.round(each * ratio));
  const pen = canvas.getContext("2d");
  // A new size is a new memory of pixels.
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  pen.reset();
  pen.scale(ratio, ratio);
  return pen;
}
