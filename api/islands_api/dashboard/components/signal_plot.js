/**
 * Plot of signals in panels. After a click the wheel zooms; dragging moves; arrow keys read values.
 *
 * The service sends the extremes of as many parts of the rows as the plot has pixels. A new range is drawn at
 * once from the last answer, and again when its own answer arrives.
 */

import { el, setText } from "../lib/dom.js";
import { formatCount, formatNumber, formatShort } from "../lib/numbers.js";
import { makeScale } from "../lib/scale.js";
import { drawEnvelope, drawNames, strokeLine } from "./signal_lines.js";

const [PANEL, TALL_PANEL, GAP, LEFT, BOTTOM] = [110, 150, 14, 62, 36];

/** How a plot is read; for a text beside it. */
export const HINT = "Click, then wheel: zoom. Drag: move. Keys: arrows, +, −, Home.";

/** Fewest rows of a range, largest number of points of a request, and panels of a plot. */
const [LEAST_ROWS, MOST_POINTS, MOST_PANELS] = [8, 2000, 8];

/** Factor of the range for a step of the wheel or a key. */
const ZOOM = 1.25;

/** Milliseconds without a change of the range before its samples are requested. */
const PAUSE = 120;

const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

/** Return a range of at least some rows, inside of the record. */
function limitRange(start, stop, rows) {
  const length = clamp(stop - start, Math.min(LEAST_ROWS, rows), rows);
  const from = clamp(start, 0, rows - length);
  return [from, from + length];
}

/** Return the place of the part that contains a row; -1 if the answer does not cover it. */
function findPart({ rows, stop }, row) {
  if (!rows.length || row < rows[0] || row >= stop) return -1;
  let [low, high] = [0, rows.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (rows[middle] <= row) low = middle;
    else high = middle - 1;
  }
  return low;
}

/**
 * Make a plot of a record of `samples` rows, those from `heldOut` on with another background.
 *
 * `ask(query, names)` requests the rows `start` to `stop` of signals as at most `points` parts.
 * `show(panels)` selects the panels, each a list of lines `{name, unit, colour}` over one axis; a colour is a
 * custom property of the style. `onRange([start, stop])` is called with the rows that are visible.
 */
export function makeSignalPlot({ samples, dt, heldOut = samples, ask }, onRange, signal) {
  const canvas = el("canvas", { "aria-hidden": "true" });
  const plot = el("div", { class: "signals", tabindex: "0", role: "slider", "aria-label": "Record" }, canvas);
  const position = el("p", { class: "position soft small" });
  let [panels, range, pointed, answer] = [[], [0, samples], null, null];
  let timer;

  const describeRow = (row) =>
    dt === null ? `row ${formatCount(row)}` : `${formatShort(Number((row * dt).toPrecision(6)))} s`;
  const getX = () => makeScale(range, [LEFT, plot.clientWidth - 8], { maxTicks: 8 });

  async function request() {
    const [start, stop] = [Math.floor(range[0]), Math.ceil(range[1])];
    const points = clamp(Math.round(plot.clientWidth), 1, MOST_POINTS);
    const asked = panels;
    const names = new Set(panels.flat().map(({ name }) => name));
    const found = await ask(new URLSearchParams({ start, stop, points }), [...names]);
    if (asked !== panels) return;
    answer = found;
    draw();
  }

  function load() {
    clearTimeout(timer);
    timer = setTimeout(
      () => panels.length && request().catch((error) => signal.aborted || setText(position, error.message)),
      answer === null ? 0 : PAUSE,
    );
  }

  function draw() {
    const width = plot.clientWidth;
    const heights = panels.map((lines) => (lines.length > 1 ? TALL_PANEL : PANEL));
    const height = heights.reduce((sum, each) => sum + each + GAP, BOTTOM);
    if (!width || !panels.length) return;
    const ratio = devicePixelRatio || 1;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(plot);
    const colours = Object.fromEntries(
      ["ink", "soft", "line", "tint", "accent", "before"].map((name) => [
        name,
        style.getPropertyValue(`--${name}`),
      ]),
    );
    pen.font = `11.5px ${style.fontFamily}`;
    const x = getX();
    pen.fillStyle = colours.tint;
    const shaded = Math.max(heldOut, range[0]);
    if (shaded < range[1]) pen.fillRect(x.at(shaded), 0, x.at(range[1]) - x.at(shaded), height - BOTTOM);
    drawTimes(pen, width, height, colours);
    panels.reduce((top, lines, at) => {
      drawPanel(pen, x, lines, [top, top + heights[at]], width, colours);
      return top + heights[at] + GAP;
    }, 0);
    if (pointed !== null) {
      pen.strokeStyle = colours.soft;
      pen.setLineDash([3, 3]);
      strokeLine(pen, x.at(pointed), 0, x.at(pointed), height - BOTTOM);
    }
    readValues();
  }

  function drawTimes(pen, width, height, { soft, line }) {
    pen.fillStyle = soft;
    pen.textAlign = "center";
    const limits = range.map((row) => row * (dt ?? 1));
    const times = makeScale(limits, [LEFT, width - 8], { maxTicks: 8 });
    for (const tick of times.ticks) {
      pen.strokeStyle = line;
      strokeLine(pen, times.at(tick), 0, times.at(tick), height - BOTTOM);
      const text = formatShort(tick);
      // The last one is not cut off by the edge.
      pen.fillText(text, Math.min(times.at(tick), width - pen.measureText(text).width / 2), height - 21);
    }
    pen.fillText(dt === null ? "row" : "time (s)", (LEFT + width) / 2, height - 4);
  }

  function drawPanel(pen, x, lines, [top, bottom], width, colours) {
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

  /** Show the values at the pointer, and to screen readers. */
  function readValues() {
    const row = clamp(Math.round(pointed ?? range[1] - 1), 0, samples - 1);
    const part = answer === null ? -1 : findPart(answer, row);
    const texts = (answer?.columns ?? []).map(({ name, minimum, maximum }) => {
      const [low, high] = [minimum[part], maximum[part]].map((value) => formatNumber(value));
      return `${name} ${low === high ? low : `${low} to ${high}`}`;
    });
    const text = `${describeRow(row)}: ${part < 0 ? "" : texts.join(", ")}`;
    setText(position, pointed === null ? describeRange() : text);
    const aria = { min: 0, max: samples - 1, now: row, text };
    for (const [name, value] of Object.entries(aria)) plot.setAttribute(`aria-value${name}`, value);
  }

  const describeRange = () =>
    `${describeRow(Math.floor(range[0]))} to ${describeRow(Math.ceil(range[1]))}, ` +
    `${formatCount(Math.ceil(range[1]) - Math.floor(range[0]))} of ${formatCount(samples)} rows`;

  function move(start, stop) {
    range = limitRange(start, stop, samples);
    onRange([Math.floor(range[0]), Math.ceil(range[1])]);
    draw();
    load();
  }

  /** Change the length of the range by a factor; a row keeps its place. */
  const zoom = (factor, row) => move(row + (range[0] - row) * factor, row + (range[1] - row) * factor);

  const rowAt = ({ clientX }) => getX().back(clientX - plot.getBoundingClientRect().left);

  plot.addEventListener(
    "wheel",
    (event) => {
      // Otherwise the page could not be scrolled past the plot.
      if (!event.ctrlKey && document.activeElement !== plot) return;
      event.preventDefault();
      zoom(event.deltaY > 0 ? ZOOM : 1 / ZOOM, rowAt(event));
    },
    { passive: false },
  );
  plot.addEventListener("pointerdown", (event) => plot.setPointerCapture(event.pointerId));
  plot.addEventListener("pointermove", (event) => {
    if (event.buttons & 1) {
      const rows = (event.movementX * (range[1] - range[0])) / (plot.clientWidth - LEFT - 8);
      move(range[0] - rows, range[1] - rows);
    } else {
      pointed = clamp(rowAt(event), ...range);
      draw();
    }
  });
  for (const kind of ["pointerleave", "blur"])
    plot.addEventListener(kind, () => {
      pointed = null;
      draw();
    });
  plot.addEventListener("dblclick", () => move(0, samples));
  plot.addEventListener("keydown", (event) => {
    const step = (range[1] - range[0]) / 100;
    const at = pointed ?? range[0];
    const read = (row) => {
      pointed = clamp(row, range[0], range[1] - 1);
      draw();
    };
    const actions = {
      ArrowLeft: () => read(at - step),
      ArrowRight: () => read(at + step),
      PageUp: () => move(range[0] - 20 * step, range[1] - 20 * step),
      PageDown: () => move(range[0] + 20 * step, range[1] + 20 * step),
      Home: () => move(0, samples),
      "+": () => zoom(1 / ZOOM, at),
      "-": () => zoom(ZOOM, at),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  });
  const observer = new ResizeObserver(draw);
  observer.observe(plot);
  const theme = matchMedia("(prefers-color-scheme: dark)");
  theme.addEventListener("change", draw, { signal });
  signal.addEventListener("abort", () => observer.disconnect(), { once: true });

  return {
    node: el("figure", { class: "chart" }, plot, position),
    show(chosen) {
      panels = chosen.slice(0, MOST_PANELS);
      canvas.hidden = !panels.length;
      draw();
      load();
    },
    showAll: () => move(0, samples),
  };
}
