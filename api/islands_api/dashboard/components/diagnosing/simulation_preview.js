/** Preview of a diagnosis: the calibrated simulation and the measured output, before the job runs. */

import { postJson } from "../../lib/api.js";
import { el, setText } from "../../lib/dom.js";
import { formatCount, formatPercent, formatShort } from "../../lib/numbers.js";
import { makeSignalPlot } from "../signal_plot.js";

/** Milliseconds without a change before a preview is asked for again, and its longest time for that. */
const [PAUSE, QUICK] = [500, 1000];

/** Largest number of parameters that are listed, and of points. */
const [LISTED, POINTS] = [8, 2000];

/** State an answer in a sentence. */
function describe({ error_percent: error, start, stop, samples, estimation_samples: fitted, parameters }) {
  const whole = stop - start === samples;
  const part = whole ? "all samples" : `samples ${formatCount(start)} to ${formatCount(stop)}`;
  const format = (value) => formatShort(Number(value.toPrecision(4)));
  const values = parameters
    .slice(0, LISTED)
    .map(({ name, value, unit }) => `${name} = ${format(value)} ${unit}`.trim());
  const more = parameters.length > LISTED ? ` and ${parameters.length - LISTED} more` : "";
  const calibrated = values.length ? ` Calibrated: ${values.join(", ")}${more}.` : "";
  return (
    `Error: ${formatPercent(error)} of the range of the output, over ${part}; `
    + `the first ${formatCount(fitted)} calibrate.${calibrated}`
  );
}

/** Make the plot of an answer, whose rows are counted from its first sample. */
function makePlot(answer, signal) {
  const { start, stop, dt, rows, columns, unit, estimation_samples: fitted } = answer;
  const samples = stop - start;
  const shown = { start: 0, stop: samples, rows: rows.map((row) => row - start), columns };
  const ranges = { getRanges: () => ({ validation: [fitted, samples] }) };
  const plot = makeSignalPlot({ samples, dt, ask: async () => shown }, ranges, signal);
  plot.node.firstElementChild.setAttribute("aria-label", "Preview");
  const lines = [
    { name: "measured", unit, colour: "ink" },
    { name: "simulated", unit, colour: "before" },
  ];
  // The plot has no width before the page contains it.
  requestAnimationFrame(() => plot.show([lines]));
  return plot.node;
}

/**
 * Make the preview. `makeRequest()` returns the request of a diagnosis, or null without one. `update()` is
 * called at every change of the form: a preview that was quick is then asked for again.
 */
export function makeSimulationPreview(makeRequest, signal) {
  const button = el("button", { type: "button", on: { click: run } }, "Preview");
  const message = el("p", { class: "soft small", role: "status" });
  const host = el("div");
  const row = el("div", { class: "row" }, button, message);
  const node = el("div", { class: "preview", hidden: true }, row, host);
  let [asked, isQuick, timer, drawn] = ["", false, null, null];

  function readRequest() {
    const found = makeRequest();
    if (found === null || found.simulation.kind === "column") return null;
    const { dataset, input, output, channels, rows, simulation, tolerance } = found;
    return { dataset, input, output, channels, rows, simulation, tolerance, points: POINTS };
  }

  function state(words, isComplaint = false) {
    message.classList.toggle("complaint", isComplaint);
    setText(message, words);
  }

  function clear() {
    drawn?.abort();
    drawn = null;
    host.replaceChildren();
  }

  async function run() {
    const request = readRequest();
    if (request === null) return;
    const text = JSON.stringify(request);
    [asked, isQuick] = [text, false];
    state("Calibrating…");
    const began = performance.now();
    try {
      const answer = await postJson("v1/simulations/preview", request, { signal });
      if (asked !== text) return;
      isQuick = performance.now() - began <= QUICK;
      clear();
      drawn = new AbortController();
      host.replaceChildren(makePlot(answer, AbortSignal.any([signal, drawn.signal])));
      state(describe(answer));
    } catch (error) {
      if (signal.aborted || asked !== text) return;
      // A wrong value is answered at once.
      isQuick = performance.now() - began <= QUICK;
      clear();
      state(error.message, true);
    }
  }

  function update() {
    const request = readRequest();
    node.hidden = request === null;
    clearTimeout(timer);
    const text = JSON.stringify(request);
    if (request === null || text === asked) return;
    if (isQuick) timer = setTimeout(run, PAUSE);
    else if (asked !== "") {
      asked = "";
      clear();
      state("The form has changed: preview again.");
    }
  }

  return { node, update };
}
