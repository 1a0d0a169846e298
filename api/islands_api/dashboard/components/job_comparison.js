/** Parts of the comparison of models: tables of errors, terms and settings, and charts. */

import { el, makeScrollable, makeTable } from "../lib/dom.js";
import {
  NONE,
  formatInterval,
  formatPercent,
  formatQuantity,
  formatShort,
  labelQuantity,
} from "../lib/numbers.js";
import { makeLineChart } from "./chart.js";
import { findUnit } from "./dataset.js";

const getFreeRun = ({ metrics }, part) => metrics[part]?.free_run ?? {};

const makeLink = ({ job, model, name }) => el("a", { href: `#/jobs/${job.id}/models/${model.rank}` }, name);

const getUnit = ({ job, dataset }) => findUnit(dataset?.preview.columns ?? [], job.spec);

/** Make the table of the models with their data, sizes and errors. */
export const makeModelTable = (entries) =>
  makeTable(
    "Compared models",
    [
      ...["Model", "Data set"],
      ...["Size", "Error est.", "Error val.", "RMSE val."].map((name) => [name, "figure"]),
    ],
    entries.map((entry) => {
      const { model, dataset } = entry;
      const [estimated, validated] = ["estimation", "validation"].map((part) => getFreeRun(model, part));
      return [
        makeLink(entry),
        el("bdi", {}, dataset?.name ?? "deleted"),
        String(model.size),
        formatPercent(estimated.mape),
        formatPercent(validated.mape),
        formatQuantity(validated.rmse, getUnit(entry)) ?? NONE,
      ];
    }),
  );

/** Make the list of the equations. */
export const listEquations = (entries) =>
  entries.map(({ name, model }) =>
    el("div", { class: "compared" }, el("h3", {}, name), el("code", {}, model.equation)),
  );

/** Return the models by the signal that they are compared with: its times and values. */
function groupByMeasured(entries) {
  const groups = new Map();
  for (const entry of entries) {
    const { time_s: times, measured } = entry.simulation;
    const key = JSON.stringify([entry.job.spec.output, times, measured]);
    groups.set(key, [...(groups.get(key) ?? []), entry]);
  }
  return [...groups.values()];
}

function makeOverlay(group, isOnly, signal) {
  const [first] = group;
  const { output } = first.job.spec;
  const unit = getUnit(first);
  const names = group.map(({ name }) => name).join(" and ");
  const chart = makeLineChart({
    title: isOnly ? `Measured and simulated ${output}` : `Validation data of ${names}`,
    x: { label: "time (s)", describe: (at) => `${formatShort(at)} s` },
    y: { label: labelQuantity(output, unit) },
  }, signal);
  const { time_s: x, measured } = first.simulation;
  chart.draw([
    { name: "measured", x, y: measured },
    ...group.map(({ name, simulation }) => ({ name, x, y: simulation.free_run })),
  ]);
  return chart.node;
}

/** Make a chart for each validation data, with the free runs of all models that have them. */
export function makeOverlays(entries, signal) {
  const groups = groupByMeasured(entries);
  if (!groups.length) return [el("p", { class: "soft" }, "Models of several outputs have no common chart.")];
  return groups.map((group) => makeOverlay(group, groups.length === 1, signal));
}

/** Make the chart of the errors of all models of each job against their sizes. */
export function makeFrontChart(entries, signal) {
  const chart = makeLineChart({
    title: "Validation error of all models of each job",
    x: { label: "size", integer: true },
    y: { label: "error of the free run (%)", log: true },
    marks: true,
  }, signal);
  const jobs = [...new Map(entries.map((entry) => [entry.job.id, entry])).values()];
  chart.draw(
    jobs.map(({ models, jobName }) => {
      const sorted = models.toSorted((one, other) => one.size - other.size);
      return {
        name: jobName,
        x: sorted.map(({ size }) => size),
        y: sorted.map((model) => getFreeRun(model, "validation").mape),
      };
    }),
  );
  return chart.node;
}

/** Return a term with the names of its signals, which jobs number differently. */
const nameTerm = ({ term, regressor }) => term ?? regressor;

/** Make the table of the parameters of all terms, a column for each model. */
export function makeTermTable(entries) {
  const regressors = [...new Set(entries.flatMap(({ model }) => model.terms.map(nameTerm)))];
  return makeTable(
    "Parameters of the compared models",
    ["Term", ...entries.map(({ name }) => [name, "figure"])],
    regressors.map((regressor) => [
      el("code", { class: "term" }, regressor),
      ...entries.map(({ model }) => {
        const term = model.terms.find((each) => nameTerm(each) === regressor);
        return term ? formatInterval(term.parameter, 1.96 * term.standard_error) : NONE;
      }),
    ]),
  );
}

/** Return the settings; the table of the models names the data set. */
const flatten = ({ settings = {}, dataset: _, ...fields }) => ({ ...fields, ...settings });

const format = (value) => {
  if (value === undefined || value === null) return "default";
  if (Array.isArray(value) && value.every((each) => typeof each === "string")) return value.join(", ");
  return typeof value === "object" ? JSON.stringify(value) : String(value);
};

/** Make the table of the fields of the requests that are not equal in all jobs. */
export function makeSettingTable(entries) {
  const specs = entries.map(({ job }) => flatten(job.spec));
  const names = [...new Set(specs.flatMap(Object.keys))].filter(
    (name) => new Set(specs.map((spec) => format(spec[name]))).size > 1,
  );
  if (!names.length) return el("p", { class: "soft" }, "The jobs have the same settings.");
  const table = makeTable(
    "Settings that differ",
    ["Setting", ...entries.map(({ name }) => name)],
    names.map((name) => [el("code", {}, name), ...specs.map((spec) => format(spec[name]))]),
  );
  return makeScrollable("Settings that differ", table);
}
