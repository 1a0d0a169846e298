/** What a reader of a result looks for first: the equation, three numbers, the verdict, and the free run. */

import { getJobPath, getJson } from "../lib/api.js";
import { el, makeFacts } from "../lib/dom.js";
import { formatPercent, formatQuantity, formatShort, labelQuantity } from "../lib/numbers.js";
import { makeLineChart } from "./chart.js";
import { makeEquation } from "./models.js";
import { makeTryModel } from "./try_model.js";

/** Beginnings of the sentences of the summary that are shown: the verdict, physics, limits, a refit. */
const SHOWN = ["As a simulation", "Physics", "Fails at", "Refit"];

/** Return the median of half the width of a band; NaN if there is none. */
function findHalfWidth({ band }) {
  const widths = (band?.lower ?? [])
    .map((low, at) => (band.upper[at] - low) / 2)
    .filter((value) => value > 0)
    .sort((a, b) => a - b);
  return widths[widths.length >> 1] ?? NaN;
}

/** Make the chart of measured and simulated output, with the band as its background. */
function drawSimulation(chart, { time_s: x, measured, free_run: free, band }) {
  const limits = band ? [band.lower, band.upper] : [];
  chart.draw([
    ...limits.map((y, at) => ({ name: `limit ${at}`, x, y, faint: true })),
    { name: "measured", x, y: measured },
    { name: "free run", x, y: free },
  ]);
}

/** State which columns the symbols of the equation are, and the sampling time that k counts. */
function describeSymbols({ inputs, output }, columns, words) {
  // `u_V+1` is the column `u_V` advanced by one sample.
  const isColumn = (name) => (each) => [name, name.replace(/\+\d+$/, "")].includes(each.name);
  const unitOf = (name) => columns.find(isColumn(name))?.unit;
  const symbols = inputs.length > 1 ? inputs.map((_, at) => `u${at + 1}`) : ["u"];
  const names = [["y", output], ...symbols.map((symbol, at) => [symbol, inputs[at]])];
  const listed = names.map(([symbol, name]) => `${symbol}: ${labelQuantity(name, unitOf(name))}`);
  const [, clock] = /k counts (samples of \S+ s)/.exec(words) ?? [];
  return [...listed, ...(clock ? [`k: ${clock}`] : [])].join("; ");
}

/**
 * Make the card of the recommended model of a job of one output. `unit` is that of the output; `columns` are
 * those of the data set, none if it has been deleted.
 */
export function makeResultCard(job, unit, columns, signal) {
  const { rank, size, metrics, words = "" } = job.summary;
  const path = `${getJobPath(job.id)}/models/${rank}`;
  const sentences = words.split("\n").filter((line) => SHOWN.some((start) => line.startsWith(start)));
  const symbols = describeSymbols(job.spec, columns, words);
  const facts = el("div");
  const showFacts = (half) =>
    facts.replaceChildren(
      makeFacts([
        ["Mean error, free run", `${formatPercent(metrics.mape)} of the range`],
        ["RMSE, free run", formatQuantity(metrics.rmse, unit)],
        ["90 % band, half-width", formatQuantity(half, unit)],
        ["Parameters", String(size)],
      ]),
    );
  const chart = makeLineChart({
    title: "Free run on the validation data",
    x: { label: "time (s)", describe: (at) => `${formatShort(at)} s` },
    y: { label: labelQuantity(job.spec.output, unit) },
  }, signal);
  const note = el("p", { class: "loading" }, "Simulating the validation data…");
  showFacts(NaN);
  getJson(`${path}/simulation`, { signal }).then(
    (simulation) => {
      showFacts(findHalfWidth(simulation));
      drawSimulation(chart, simulation);
      note.remove();
    },
    (error) => signal.aborted || note.replaceWith(el("p", { class: "complaint" }, error.message)),
  );
  return el(
    "section",
    { class: "card result", "aria-label": "Result" },
    el("h2", { class: "visually-hidden" }, "Result"),
    makeEquation(path, { equation: job.summary.equation }, signal),
    el("p", { class: "soft small symbols" }, symbols),
    facts,
    note,
    chart.node,
    sentences.map((line) => el("p", {}, line)),
    makeTryModel(path, job.spec, signal),
  );
}
