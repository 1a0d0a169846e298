/** Comparison of models of any jobs: free runs, errors, fronts, parameters, settings that differ. */

import { makeComparisonReportButtons } from "../components/comparison_report.js";
import {
  listEquations,
  makeFrontChart,
  makeModelTable,
  makeOverlays,
  makeSettingTable,
  makeTermTable,
} from "../components/job_comparison.js";
import { listRefits } from "../components/refit.js";
import { getDatasetPath, getJobPath, getJson } from "../lib/api.js";
import { el, makeScrollable } from "../lib/dom.js";
import { poll } from "../lib/polling.js";

/** Most models of a comparison: the colours of a chart stay distinct. */
export const MOST_MODELS = 6;


/** Parse `a,b:2`: ids of jobs, each with the rank of a model; the recommended one without a rank. */
const parseModels = (text) =>
  text
    .split(",")
    .filter(Boolean)
    .map((each) => each.split(":"))
    .map(([id, rank]) => ({ id, rank: Number(rank) || null }));

/** Load a model with its job; `reason` is why it cannot be compared. */
async function loadModel({ id, rank }, signal) {
  let job = null;
  try {
    job = await getJson(getJobPath(id), { signal });
    const models = (await getJson(`${getJobPath(id)}/models`, { signal })).items;
    const model = models.find((each) => (rank ? each.rank === rank : each.recommended)) ?? models[0];
    if (!model) return { job, id, reason: `the job is ${job.state} and has no models` };
    const path = getDatasetPath(job.spec.dataset);
    const dataset = await getJson(path, { signal }).catch(() => null);
    return { job, models, model, dataset };
  } catch (error) {
    if (signal.aborted) throw error;
    return { job, id, reason: error.message };
  }
}

/** Name the jobs, with the start of the id if two have the same name, and the models by their rank. */
function nameModels(entries) {
  const jobs = new Map(entries.map(({ job }) => [job.id, job.name]));
  const names = [...jobs.values()];
  return entries.map((entry) => {
    const { id, name } = entry.job;
    const isUnique = name && names.filter((each) => each === name).length === 1;
    const jobName = isUnique ? name : `${name} ${id.slice(0, 8)}`.trim();
    return { ...entry, jobName, name: `${jobName}, model ${entry.model.rank}` };
  });
}

/** State whether the models are validated on the same rows; errors of different data are not comparable. */
function describeData(entries) {
  const key = ({ job: { spec } }) =>
    JSON.stringify([spec.dataset, spec.output, spec.rows, spec.recordings, spec.validation, spec.dt]);
  const areEqual = (values) => new Set(values).size === 1;
  if (areEqual(entries.map(key))) return el("p", { class: "soft data" }, "All models have the same data.");
  const text = areEqual(entries.map(({ dataset, job }) => dataset?.sha256 ?? job.spec.dataset))
    ? "The jobs use different rows, columns or options of reading of the same file"
    : "The jobs use different data sets";
  return el("p", { class: "warning data" }, `${text}: their errors are those of different validation data.`);
}

/** Make the charts of the free runs, which the service calculates one after the other. */
function makeRuns(entries, signal) {
  const host = el("div", { class: "stack" }, el("p", { class: "loading", role: "status" }, "Simulating…"));
  const load = ({ job, model }) =>
    getJson(`${getJobPath(job.id)}/models/${model.rank}/simulation`, { signal });
  const simulated = entries.filter(({ job }) => !Array.isArray(job.spec.output));
  Promise.all(simulated.map(async (entry) => ({ ...entry, simulation: await load(entry) }))).then(
    (found) => host.replaceChildren(...makeOverlays(found, signal)),
    (error) => signal.aborted || host.replaceChildren(el("p", { class: "complaint" }, error.message)),
  );
  return host;
}

const makeCard = (title, ...content) => el("section", { class: "card" }, el("h2", {}, title), content.flat());

function makeContent(found, signal) {
  const lost = found.filter(({ reason }) => reason);
  const entries = nameModels(found.filter(({ reason }) => !reason));
  const messages = lost.map(({ id, job, reason }) =>
    el("p", { class: "complaint" }, `${job?.name || id.slice(0, 8)}: ${reason}`),
  );
  if (!entries.length) return messages;
  return [
    ...messages,
    makeCard(
      "Models",
      describeData(entries),
      makeScrollable("Compared models", makeModelTable(entries)),
      listRefits(entries),
      listEquations(entries),
      entries.length > 1 ? makeComparisonReportButtons(entries) : [],
    ),
    makeCard("Free runs on the validation data", makeRuns(entries, signal)),
    makeCard("Error against size", makeFrontChart(entries, signal)),
    makeCard("Parameters", makeScrollable("Parameters", makeTermTable(entries))),
    makeCard("Settings that differ", makeSettingTable(entries)),
  ];
}

/** Show the comparison in a host until the signal aborts. */
export function mountCompare(host, { jobs = "" }, signal) {
  document.title = "Compare · islands";
  const asked = parseModels(jobs);
  const body = el("div", { class: "stack" }, el("p", { class: "loading" }, "Loading…"));
  host.replaceChildren(
    el("a", { class: "back", href: "#/jobs" }, "← Jobs"),
    el("div", { class: "heading" }, el("h1", { tabindex: "-1" }, "Compare")),
    body,
  );
  if (asked.length < 2) {
    body.replaceChildren(el("p", { class: "empty" }, "Select two or more jobs in the list to compare them."));
    return {};
  }
  const rest = asked.length - MOST_MODELS;
  const text = `${rest} more are left out: at most ${MOST_MODELS} are compared.`;
  const note = rest > 0 && el("p", { class: "soft" }, text);
  poll(async () => {
    const found = await Promise.all(asked.slice(0, MOST_MODELS).map((each) => loadModel(each, signal)));
    if (!signal.aborted) body.replaceChildren(...[note, ...makeContent(found, signal)].filter(Boolean));
    return Infinity;
  }, signal);
  return {};
}
