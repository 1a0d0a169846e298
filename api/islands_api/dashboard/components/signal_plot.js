/**
 * Plot of columns of a data set, one panel each. After a click the wheel zooms; dragging moves; arrow keys
 * read values.
 *
 * The service sends the extremes of as many parts of the rows as the plot has pixels. A new range is drawn at
 * once from the last answer, and again when its own answer arrives.
 */

import { getJson } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";
import { formatCount, formatNumber, formatShort } from "../lib/numbers.js";
import { makeScale } from "../lib/scale.js";

const [PANEL, GAP, LEFT, BOTTOM] = [110, 14, 62, 36];

/** Fewest rows of a range, largest number of points of a request, and columns of a plot. */
const [LEAST_ROWS, MOST_POINTS, MOST_COLUMNS] = [8, 2000, 8];

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
 * Make the plot of a data set with `preview`; `show(names)` selects its columns, `onRange([start, stop])` is
 * called with the rows that are visible.
 */
export function makeSignalPlot({ id, preview }, onRange, signal) {
  const { samples, dt } = preview;
  const units = Object.fromEntries(preview.columns.map(({ name, unit }) => [name, unit]));
  const canvas = el("canvas", { "aria-hidden": "true" });
  const plot = el("div", { class: "signals", tabindex: "0", role: "slider", "aria-label": "Record" }, canvas);
  const position = el("p", { class: "position soft small" });
  let [names, range, pointed, answer] = [[], [0, samples], null, null];
  let timer;

  const describeRow = (row) =>
    dt === null ? `row ${formatCount(row)}` : `${formatShort(Number((row * dt).toPrecision(6)))} s`;
  const getX = () => makeScale(range, [LEFT, plot.clientWidth - 8], { maxTicks: 8 });

  async function request() {
    const [start, stop] = [Math.floor(range[0]), Math.ceil(range[1])];
    const points = clamp(Math.round(plot.clientWidth), 1, MOST_POINTS);
    const query = new URLSearchParams({ start, stop, points });
    for (const name of names) query.append("column", name);
    const asked = names;
    const found = await getJson(`v1/datasets/${encodeURIComponent(id)}/samples?${query}`, { signal });
    if (asked !== names) return;
    answer = found;
    draw();
  }

  function load() {
    clearTimeout(timer);
    timer = setTimeout(
      () => names.length && request().catch((error) => signal.aborted || setText(position, error.message)),
      answer === null ? 0 : PAUSE,
    );
  }

  function draw() {
    const width = plot.clientWidth;
    const height = names.length * (PANEL + GAP) + BOTTOM;
    if (!width || !names.length) return;
    const ratio = devicePixelRatio || 1;
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const style = getComputedStyle(plot);
    const colours = Object.fromEntries(
      ["ink", "soft", "line", "accent"].map((name) => [name, style.getPropertyValue(`--${name}`)]),
    );
    pen.font = `11.5px ${style.fontFamily}`;
    const x = getX();
    drawTimes(pen, width, height, colours);
    names.forEach((name, at) => drawPanel(pen, x, name, at, width, colours));
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
      pen.fillText(formatShort(tick), times.at(tick), height - 21);
    }
    pen.fillText(dt === null ? "row" : "time (s)", (LEFT + width) / 2, height - 4);
  }

  function drawPanel(pen, x, name, at, width, { ink, soft, line, accent }) {
    const [top, bottom] = [at * (PANEL + GAP), at * (PANEL + GAP) + PANEL];
    const column = answer?.columns.find((each) => each.name === name);
    const values = column ? [...column.minimum, ...column.maximum].filter((value) => value !== null) : [];
    const y = makeScale(values, [bottom - 4, top + 20], { padding: 0.05, maxTicks: 4 });
    pen.textAlign = "right";
    pen.fillStyle = soft;
    const ticks = values.length ? y.ticks : [];
    for (const tick of ticks) pen.fillText(formatShort(tick), LEFT - 6, y.at(tick) + 4);
    pen.strokeStyle = line;
    strokeLine(pen, LEFT, bottom, width, bottom);
    pen.textAlign = "left";
    pen.fillStyle = ink;
    pen.fillText(units[name] ? `${name} (${units[name]})` : name, LEFT + 4, top + 11);
    if (!column) return;
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, top, width - LEFT, PANEL);
    pen.clip();
    pen.strokeStyle = accent;
    pen.lineWidth = 1.3;
    pen.beginPath();
    let isDown = false;
    answer.rows.forEach((row, part) => {
      const [low, high] = [column.minimum[part], column.maximum[part]];
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
      names = chosen.slice(0, MOST_COLUMNS);
      canvas.hidden = !names.length;
      draw();
      load();
    },
    showAll: () => move(0, samples),
  };
}

function strokeLine(pen, fromX, fromY, toX, toY) {
  pen.lineWidth = 1;
  pen.beginPath();
  pen.moveTo(fromX, fromY);
  pen.lineTo(toX, toY);
  pen.stroke();
}
