/** Next experiment of a diagnosis: the separation of each pair of causes, and the input as plot and file. */

import { getJobPath, getText } from "../../lib/api.js";
import { el, makeFacts, makeScrollable, makeTable } from "../../lib/dom.js";
import { formatCount, formatDuration, formatNumber, formatQuantity } from "../../lib/numbers.js";
import { makeSaveButton } from "../report.js";
import { HINT, makeSignalPlot } from "../signal_plot.js";

const ABOUT =
  "The record does not tell these causes apart. Each separation is the distance of the outputs that both "
  + "predict, after one was calibrated to the other, in standard deviations of the noise.";

/** Return the values of the second column of a CSV file. */
const parseValues = (text) =>
  text.trimEnd().split("\n").slice(1).map((line) => Number(line.slice(line.indexOf(",") + 1)));

/** Return the extremes of values in at most `points` parts of the rows, as the service answers a plot. */
function findExtremes(name, values, { start, stop, points }) {
  const every = Math.max(1, Math.ceil((stop - start) / points));
  const rows = Array.from({ length: Math.ceil((stop - start) / every) }, (_, part) => start + part * every);
  const take = (choose) => rows.map((row) => choose(...values.slice(row, Math.min(row + every, stop))));
  return { rows, stop, columns: [{ name, minimum: take(Math.min), maximum: take(Math.max) }] };
}

/** Make the plot of the input of a job; the file is requested once. */
function makeInputPlot(job, { name, unit, samples, dt }, signal) {
  let values = null;
  const ask = async (query) => {
    values ??= getText(`${getJobPath(job.id)}/next-experiment`, { signal }).then(parseValues);
    const [start, stop, points] = ["start", "stop", "points"].map((each) => Number(query.get(each)));
    return findExtremes(name, await values, { start, stop, points });
  };
  const label = "Input of the next experiment";
  const plot = makeSignalPlot({ samples, dt, ask, label }, { getRanges: () => ({}) }, signal);
  // The plot has no width before the page contains it.
  requestAnimationFrame(() => plot.show([[{ name, unit, colour: "accent" }]]));
  return el("div", { class: "outputs" }, plot.node, el("p", { class: "soft small" }, HINT));
}

/** State a limit of the input, and by which factor it exceeds that of the record. */
const describeLimit = (text, excess) =>
  excess > 1 ? `${text}, ${formatNumber(excess)} times that of the record` : `${text}, within the record`;

function makeInputFacts({ description, unit, samples, dt, limits, range_excess, rate_excess }) {
  const range = `${formatNumber(limits.lower)} to ${formatQuantity(limits.upper, unit)}`;
  const rate = formatQuantity(limits.rate, unit ? `${unit}/s` : "1/s");
  return makeFacts([
    ["Input", description],
    ["Duration", `${formatDuration(samples * dt)}, ${formatCount(samples)} samples`],
    ["Range", describeLimit(range, range_excess)],
    ["Largest rate", describeLimit(rate, rate_excess)],
  ]);
}

function makePairTable(pairs) {
  const format = (separation) => (separation === null ? "unknown" : separation.distance.toFixed(1));
  const figures = ["In this record", "In the next", "Needed", "Runs"].map((each) => [each, "figure"]);
  const rows = pairs.map(({ causes, recorded, predicted, repeats }) => [
    causes.join(" or "),
    format(recorded),
    format(predicted),
    format(predicted && { distance: predicted.required_distance }),
    repeats === null ? "not separable" : String(repeats),
  ]);
  const table = makeTable("Causes that the record does not tell apart", ["Causes", ...figures], rows);
  return makeScrollable("Causes that the record does not tell apart", table);
}

/** Make the section of the next experiment of a result; null if there is nothing to separate. */
export function makeNextExperiment(job, { next_experiment: experiment, decisive_experiment: words }, signal) {
  // Without an input and words, the record separates all causes.
  if (!experiment || !(experiment.input || words)) return null;
  const { pairs, input } = experiment;
  const file = `next-experiment-${job.id.slice(0, 8)}.csv`;
  return el(
    "section",
    { class: "card stack next-experiment" },
    el("h2", {}, "Next experiment"),
    el("p", { class: "soft small" }, ABOUT),
    makePairTable(pairs),
    input === null
      ? words && el("p", {}, `${words}.`)
      : [
          makeInputFacts(input),
          makeInputPlot(job, input, signal),
          el("div", { class: "row" }, makeSaveButton(job, "Save the input (CSV)", "next-experiment", file)),
        ],
  );
}
