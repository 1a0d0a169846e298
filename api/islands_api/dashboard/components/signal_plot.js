/**
 * Plot of signals in panels. After a click the wheel zooms; dragging moves the rows, or marks a range; arrow
 * keys read values.
 *
 * A new range is drawn at once from the samples in memory, and again when its own samples arrive. All changes
 * before a frame of the screen are one drawing; a drawing reads nothing that needs a new layout.
 */

import { theme } from "../lib/canvas.js";
import { el, setText } from "../lib/dom.js";
import { formatCount, formatNumber, formatShort } from "../lib/numbers.js";
import { LEFT, RIGHT, drawSignals, makeRowScale, readColours } from "./signal_panels.js";
import { findPart, makeSamples } from "./signal_samples.js";

/** Distance in pixels from an edge of a marked range in which a drag moves the edge. */
const EDGE = 7;

/** How a plot is read. */
export const HINT = "Click, then wheel: zoom. Drag: move. Keys: arrows, +, −, Home.";

/** Fewest rows of a range, and largest number of panels of a plot. */
const [LEAST_ROWS, MOST_PANELS] = [8, 8];

/** Factor of the range for a step of the wheel or a key. */
const ZOOM = 1.25;

/** Pixels of a step of the wheel; a touchpad sends parts of it, and for a pinch still smaller ones. */
const [STEP, PINCH_STEP] = [100, 10];

const clamp = (value, low, high) => Math.max(low, Math.min(high, value));

/** Return a range of at least some rows, inside of the record. */
function limitRange(start, stop, rows) {
  const length = clamp(stop - start, Math.min(LEAST_ROWS, rows), rows);
  const from = clamp(start, 0, rows - length);
  return [from, from + length];
}

/** Return the steps of the wheel of an event, at most one; positive ones zoom out. */
function countSteps({ deltaMode, deltaY, ctrlKey }) {
  if (deltaMode !== WheelEvent.DOM_DELTA_PIXEL) return Math.sign(deltaY);
  return clamp(deltaY / (ctrlKey ? PINCH_STEP : STEP), -1, 1);
}

/**
 * Make a plot of a record of `samples` rows, named `label`; without `dt` its axis counts rows.
 *
 * `ask(query, names)` requests the rows `start` to `stop` of signals as at most `points` parts.
 * `show(panels)` selects the panels, each a list of lines `{name, unit, colour}` over one axis; a colour is a
 * custom property of the style. `showRows(rows)` marks rows and moves to them.
 *
 * `ranges.getRanges()` returns the marked ranges by name. With `ranges.set(name, rows)`, a drag moves their
 * edges, and `mark(name)` selects the range that a drag marks; null for a drag that moves the rows.
 */
export function makeSignalPlot({ samples, dt, ask, label = "Record" }, ranges, signal) {
  const canvas = el("canvas", { "aria-hidden": "true" });
  const plot = el("div", { class: "signals", tabindex: "0", role: "slider", "aria-label": label }, canvas);
  const position = el("p", { class: "position soft small" });
  let [panels, range, pointed] = [[], [0, samples], null];
  let [marks, marking, drag] = [[], null, null];
  let [width, colours, frame, failure] = [0, null, 0, ""];

  const describeRow = (row) =>
    dt === null ? `row ${formatCount(row)}` : `${formatShort(Number((row * dt).toPrecision(6)))} s`;
  const getX = () => makeRowScale(range, width);
  const fail = (error) => {
    failure = error.message;
    draw();
  };
  const loaded = makeSamples(samples, ask, { changed: draw, failed: fail }, signal);

  function load() {
    failure = "";
    if (width && panels.length) loaded.want(range, width);
  }

  /** Draw in the next frame of the screen. */
  function draw() {
    frame ||= requestAnimationFrame(drawNow);
  }

  function drawNow() {
    frame = 0;
    if (!width || !panels.length) return;
    colours ??= readColours(getComputedStyle(plot));
    const answers = loaded.find(range);
    const marked = ranges.getRanges();
    drawSignals(canvas, { panels, range, dt, answers, ranges: marked, marks, pointed, width }, colours);
    readValues(answers);
  }

  /** Return the values of the columns at a row. */
  function describeValues(answers, row) {
    const answer = answers.findLast(({ rows, first }) => rows[first] <= row);
    if (!answer) return [];
    const { rows, columns } = answer;
    const part = findPart(rows, row);
    return [...columns].map(([name, { minimum, maximum }]) => {
      const [low, high] = [minimum[part], maximum[part]].map((value) => formatNumber(value));
      return `${name} ${low === high ? low : `${low} to ${high}`}`;
    });
  }

  /** Show the values at the pointer, and to screen readers. */
  function readValues(answers) {
    const row = clamp(Math.round(pointed ?? range[1] - 1), 0, samples - 1);
    const text = `${describeRow(row)}: ${describeValues(answers, row).join(", ")}`;
    const state = loaded.isEmpty() ? "Reading the samples…" : describeRange();
    setText(position, failure || (pointed === null || loaded.isEmpty() ? state : text));
    const aria = { min: 0, max: samples - 1, now: row, text };
    for (const [name, value] of Object.entries(aria)) plot.setAttribute(`aria-value${name}`, value);
  }

  const describeRange = () =>
    `${describeRow(Math.floor(range[0]))} to ${describeRow(Math.ceil(range[1]))}, ` +
    `${formatCount(Math.ceil(range[1]) - Math.floor(range[0]))} of ${formatCount(samples)} rows`;

  function move(start, stop) {
    range = limitRange(start, stop, samples);
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
      zoom(ZOOM ** countSteps(event), rowAt(event));
    },
    { passive: false },
  );

  /** Return the range whose edge is at the pointer, and its other edge, as `{kind, fixed}`. */
  function findEdge({ clientX }) {
    if (!ranges.set) return null;
    const [x, at] = [getX(), clientX - plot.getBoundingClientRect().left];
    for (const [kind, marked] of Object.entries(ranges.getRanges())) {
      const place = (marked ?? []).findIndex((row) => Math.abs(x.at(row) - at) <= EDGE);
      if (place >= 0) return { kind, fixed: marked[1 - place] };
    }
    return null;
  }

  const limitRow = (row) => clamp(Math.round(row), 0, samples);

  function startDrag(event) {
    plot.setPointerCapture(event.pointerId);
    const edge = findEdge(event);
    drag = marking ? { kind: marking, fixed: limitRow(rowAt(event)) } : edge;
    // The two ranges touch in the default split: the edge of the range that is selected moves.
    if (marking && edge?.kind === marking) drag = edge;
  }

  function continueDrag(event) {
    if (drag === null) {
      const rows = (event.movementX * (range[1] - range[0])) / (width - LEFT - RIGHT);
      move(range[0] - rows, range[1] - rows);
      return;
    }
    const rows = [drag.fixed, limitRow(rowAt(event))].sort((a, b) => a - b);
    if (rows[1] - rows[0] >= LEAST_ROWS) ranges.set(drag.kind, rows);
  }

  plot.addEventListener("pointerdown", startDrag);
  plot.addEventListener("pointerup", () => (drag = null));
  plot.addEventListener("pointermove", (event) => {
    if (event.buttons & 1) continueDrag(event);
    else {
      plot.classList.toggle("edge", findEdge(event) !== null);
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
  const observer = new ResizeObserver(([{ contentRect }]) => {
    width = contentRect.width;
    draw();
    load();
  });
  observer.observe(plot);
  theme.addEventListener("change", () => {
    colours = null;
    draw();
  }, { signal });
  signal.addEventListener("abort", () => observer.disconnect(), { once: true });

  return {
    node: el("figure", { class: "chart" }, plot, position),
    show(chosen) {
      panels = chosen.slice(0, MOST_PANELS);
      canvas.hidden = !panels.length;
      loaded.select([...new Set(panels.flat().map(({ name }) => name))]);
      draw();
      load();
    },
    draw,
    showAll: () => move(0, samples),
    getVisibleRows: () => [Math.floor(range[0]), Math.ceil(range[1])],
    mark(kind) {
      marking = kind;
      plot.classList.toggle("marking", kind !== null);
    },
    showRows(rows) {
      marks = rows;
      const [first, last] = [Math.min(...rows), Math.max(...rows)];
      const space = Math.max(20, (last - first) / 4);
      move(first - space, last + space);
      plot.focus();
      plot.scrollIntoView({ block: "center" });
    },
  };
}
