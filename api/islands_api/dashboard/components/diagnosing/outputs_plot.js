/** Plot of the measured, simulated and extended output of a finished diagnosis, and of its residuals. */

import { getJobPath, getJson } from "../../lib/api.js";
import { el } from "../../lib/dom.js";
import { HINT, makeSignalPlot } from "../signal_plot.js";

/** Colours of the simulated outputs and of their residuals. */
const COLOURS = ["before", "accent"];

/** Return the name of the residual of a simulated output. */
const nameResidual = (output) => `residual ${output}`;

/** Return the function that requests the outputs of a job for a plot. */
const askOutputs = (job, signal) => async (query) => {
  const path = `${getJobPath(job)}/outputs?${query}`;
  const { outputs, residuals, ...part } = await getJson(path, { signal });
  const named = residuals.map((each) => ({ ...each, name: nameResidual(each.name) }));
  return { ...part, columns: [...outputs, ...named] };
};

/** Make the plot of a job with its result; a result of an earlier version has none. */
export function makeOutputsPlot(job, { record, verdict, gain, estimation_samples: heldOut }, signal) {
  if (heldOut === undefined) return null;
  const ask = askOutputs(job.id, signal);
  const { samples, dt } = record;
  const ranges = { getRanges: () => ({ validation: [heldOut, samples] }) };
  const plot = makeSignalPlot({ samples, dt, ask }, ranges, signal);
  const after = verdict === "gross error" ? "corrected" : "extended";
  const names = gain === null ? ["simulated"] : ["simulated", after];
  const makeLine = (name, at) => ({ name, unit: record.units.output, colour: COLOURS[at] ?? "ink" });
  const simulated = names.map(makeLine);
  const residuals = names.map((name, at) => makeLine(nameResidual(name), at));
  // The plot has no width before the page contains it.
  requestAnimationFrame(() => plot.show([[makeLine("measured"), ...simulated], residuals]));
  const all = el("button", { type: "button", class: "quiet", on: { click: plot.showAll } }, "Show all rows");
  const text = `Shaded: held out, not used for fitting. ${HINT}`;
  return el("div", { class: "outputs" }, plot.node, el("p", { class: "soft small" }, text, all));
}
