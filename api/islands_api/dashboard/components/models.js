/** Models of a succeeded job of one or several outputs: metrics, equation, figures and exports. */

import { download, getJobPath, getJson } from "../lib/api.js";
import { el, makeFacts, makeScrollable, makeTable, runOnceAtATime } from "../lib/dom.js";
import { formatNumber, formatPercent, formatShort, nameSize } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";
import { showProblem } from "./banner.js";
import { makeCompareChoice } from "./compare_choice.js";
import { loadEquations } from "./equation.js";
import { makeFigure } from "./figures.js";
import { makeLinearSystem } from "./linear_system.js";
import { listRefits } from "./refit.js";
import { makeReportButtons } from "./report.js";
import { makeScenarioUpload } from "./scenario_upload.js";
import { makeModelFront } from "./size_front.js";
import { makeExactValue, makeQuantityPanel, makeTermPanel } from "./term_table.js";

/** Display names of the export formats. */
const EXPORTS = {
  python: "Python",
  c: "C",
  matlab: "MATLAB",
  "matlab-system": "MATLAB System",
  "s-function": "S-function",
  modelica: "Modelica",
  latex: "LaTeX",
  mathml: "MathML",
  plain: "Text",
  json: "JSON",
};

const PARTS = ["estimation", "validation"];

const formatR2 = (value) =>
  Math.abs(value) < 100 ? value.toFixed(5).replace("-", "−") : formatNumber(value);

/** Make a metric of the free run of a model or output, or the kind of the outcome if there is no value. */
function makeMetric({ metrics, outcomes }, part, name, format) {
  const { rmse, [name]: value } = metrics[part].free_run;
  const outcome = outcomes?.[part].free_run ?? (rmse === null ? "diverged" : "ok");
  if (value === null && outcome !== "ok")
    return el("span", { class: "no", title: outcome }, outcome.split(":", 1)[0]);
  return makeExactValue(value, format);
}

const makeMetrics = (each) =>
  PARTS.flatMap((part) => [
    makeMetric(each, part, "mape", formatNumber),
    makeMetric(each, part, "r2", formatR2),
  ]);

const ERRORS = ["MAPE est. %", "R² est.", "MAPE val. %", "R² val."];

/** Headings of models of hysteresis. */
const HYSTERESIS_HEADINGS = ["Hold drift %", "Property 1"];

const makeVerdict = (passed, positive, negative) =>
  el("span", { class: passed ? "yes" : "no" }, passed ? positive : negative);

/** Make the verdict on the residual; results of earlier versions have the tests only. */
function makeResidualVerdict({ verdict, passed }) {
  const kind = { adequate: "yes", inadequate: "no" }[verdict] ?? "";
  return verdict ? el("span", { class: kind }, verdict) : makeVerdict(passed, "pass", "fail");
}

function makeHysteresisCells(physics) {
  const drift = physics.hold_drift_percent;
  if (physics.not_computed) return ["not computed", "not computed"];
  return [
    drift === null ? el("span", { class: "no" }, "diverged") : makeExactValue(drift, formatNumber),
    makeVerdict(physics.property_1, "holds", "fails"),
  ];
}

function makeRank(job, { rank, recommended }) {
  const name = recommended ? `Model ${rank}, recommended` : `Model ${rank}`;
  return el("a", { href: `#/jobs/${job}/models/${rank}`, "aria-label": name }, String(rank));
}

function makeRow(job, model, hysteresis, hasForms) {
  const { physics, recommended, residual_tests: residuals } = model;
  const mark = recommended ? el("span", { class: "recommended" }, " recommended") : "";
  return [
    el("span", {}, makeRank(job, model), mark),
    ...(hasForms ? [model.form] : []),
    String(model.size),
    ...makeMetrics(model),
    ...(hysteresis ? makeHysteresisCells(physics) : []),
    makeResidualVerdict(residuals),
  ];
}

/** Return whether models are of hysteresis: only these have Property 1; the drift of others is no defect. */
const claimHysteresis = (models) => models.some((model) => model.physics?.property_1);

function makeModelTable(job, models) {
  const hysteresis = claimHysteresis(models);
  const size = nameSize(models.find(({ kind }) => kind)?.kind);
  const further = hysteresis ? HYSTERESIS_HEADINGS : [];
  // Of a library that the user names, all models may be equations.
  const hasForms = models.some(({ kind }) => kind);
  const names = [size, ...ERRORS, ...further, "Free-run residual"];
  const headings = ["Rank", ...(hasForms ? ["Form"] : []), ...names.map((name) => [name, "figure"])];
  const rows = models.map((model) => makeRow(job, model, hysteresis, hasForms));
  const modelTable = makeTable("Models, least error on the validation data first", headings, rows);
  modelTable.classList.add("models");
  return modelTable;
}

/** Make the table of the errors of each of several outputs. */
function makeOutputTable(outputs) {
  const headings = ["Output", ...[...ERRORS, "Free-run residual"].map((name) => [name, "figure"])];
  const makeName = ({ name, unit }) => el("span", {}, el("bdi", {}, name), unit ? ` (${unit})` : "");
  const rows = outputs.map((each) => [makeName(each), ...makeMetrics(each), makeResidualVerdict(each.residual)]);
  return makeTable("Outputs, simulated together", headings, rows);
}

/** Format the name of a residual test in the notation of the literature. */
const formatTestName = (name) => name.replaceAll("xi", "ξ").replaceAll("2", "²").replaceAll("_", " ");

function makeResidualTable({ residual_tests: { tests } }) {
  return makeTable(
    "Residual tests",
    ["Correlation", ["Inside its limits", "figure"], ["Largest", "figure"], ["Limit", "figure"], "Verdict"],
    tests.map((test) => [
      formatTestName(test.name) + (test.input === null ? "" : `, input ${test.input + 1}`),
      formatPercent(test.inside_percent),
      formatNumber(test.largest),
      formatNumber(test.limit),
      test.note || makeVerdict(test.passed, "pass", "fail"),
    ]),
  );
}

const formatTarget = (target) => (typeof target === "number" ? `, target ${formatShort(target)}` : "");

const formatShare = (share) => (typeof share === "number" ? formatPercent(100 * share) : "diverged");

const listFailures = (physics, residuals) =>
  [["Physics checks", physics], ["Residual tests", residuals]]
    .filter(([, checks]) => checks.not_computed)
    .map(([name, checks]) => [name, `not computed: ${checks.not_computed}`]);

const listPredictable = ({ predictable_share: shares, predictable_percent: percent, not_computed: reason }) =>
  shares && !reason
    ? [
      ["Predictable residual, one step ahead", formatShare(shares.one_step_ahead)],
      ["Predictable residual, free run", formatShare(shares.free_run)],
      [
        "RMS of the predictable part",
        percent === null ? "diverged" : `${formatPercent(percent)} of the range`,
      ],
    ]
    : [];

const listClusterSum = ({ cluster, sum: value, target }) => [
  `Sum of cluster ${cluster}`,
  `${formatNumber(value, 6)}${formatTarget(target)}`,
];

const listExcursion = ({ name, bounded, range_percent: range }) => [
  `Output range, ${name}`,
  bounded ? formatPercent(range) : el("span", { class: "no" }, "diverges"),
];

function makeExportButtons(path, rank) {
  const save = (form) =>
    runOnceAtATime(() => download(`${path}/export?format=${form}`, `model-${rank}.txt`).catch(showProblem));
  const fmu = runOnceAtATime(() => download(`${path}/fmu`, `model-${rank}.fmu`).catch(showProblem));
  const button = (form, name, click) =>
    el("button", { type: "button", "data-format": form, on: { click } }, name);
  return [
    ...Object.entries(EXPORTS).map(([form, name]) => button(form, name, save(form))),
    button("fmu", "FMU", fmu),
  ];
}

export const makeExportRow = (path, rank) =>
  el(
    "div",
    { class: "row exports", role: "group", "aria-label": "Export the model as" },
    el("span", { class: "soft", "aria-hidden": "true" }, "Export as"),
    makeExportButtons(path, rank),
  );

export function makeEquation(path, model, signal) {
  const host = makeScrollable("Equation", el("code", { class: "plain" }, model.equation));
  host.classList.add("equation");
  loadEquations(path, signal).then(
    (equations) => host.replaceChildren(...equations),
    // The plain text of the equation stays visible.
    (error) => signal.aborted || showProblem(error),
  );
  return host;
}

function makeGallery(path, signal, skip = () => false) {
  const host = el("div", { class: "gallery" });
  poll(async () => {
    const { items } = await getJson(`${path}/figures`, { signal });
    const names = items.filter((name) => !skip(name));
    host.replaceChildren(...names.map((name) => makeFigure(`${path}/figures`, name, signal)));
    return Infinity;
  }, signal);
  return host;
}

/** Make the parameters of a model with the checks that are those of one output. */
function listChecks(model, hysteresis) {
  const { physics, information } = model;
  return [
    el(
      "div",
      { class: "pair" },
      makeTermPanel(model),
      el(
        "div",
        {},
        el("h4", {}, "Residual tests, one step ahead"),
        makeScrollable("Residual tests", makeResidualTable(model)),
      ),
    ),
    makeFacts([
      ...listFailures(physics, model.residual_tests),
      ...listPredictable(model.residual_tests),
      ...(hysteresis ? physics.clusters.map(listClusterSum) : []),
      ...physics.excursions.map(listExcursion),
      ["AIC", formatNumber(information.aic, 6)],
      ["BIC", formatNumber(information.bic, 6)],
    ]),
  ];
}

/** Make the equation and the terms of the model of several outputs, or modes and gains. */
const listParameters = (path, model, names, signal) =>
  // The parameters of a state space are coordinates, and have no meaning one by one.
  model.quantities
    ? [makeQuantityPanel(model, names)]
    : [makeEquation(path, model, signal), makeTermPanel(model)];

function makeDetail(job, model, { hysteresis, names }, signal) {
  const path = `${getJobPath(job.id)}/models/${model.rank}`;
  const [equation, ...parameters] = names
    ? listParameters(path, model, names, signal)
    : [makeEquation(path, model, signal), ...listChecks(model, hysteresis)];
  return [
    el("h3", { id: "model" }, `Model ${model.rank}`),
    equation,
    makeExportRow(path, model.rank),
    ...parameters,
    makeGallery(path, signal),
    // A static model has no poles, and no response to a step.
    ...(model.form === "static" ? [] : [makeLinearSystem(path, job.spec, signal)]),
    ...(names ? [makeScenarioUpload(path, job.spec.output, signal)] : []),
  ];
}

/** Make the figures of the whole search, loaded when the section is opened. */
function makeSearchFigures(job, islands, signal) {
  const path = getJobPath(job);
  const convergence = islands ? ", convergence" : "";
  const title = el("summary", {}, `Figures of the search: record, Pareto front${convergence}`);
  const node = el("details", { class: "search" }, title);
  // The figure that compares islands needs at least two.
  const open = () => node.append(makeGallery(path, signal, (name) => name === "islands" && islands < 2));
  node.addEventListener("toggle", open, { once: true });
  return node;
}

/** Make the sentences about the recommended model; results of earlier versions have none. */
function makeSentences(job) {
  const lines = job.summary?.words?.split("\n") ?? [];
  return el(
    "div",
    { class: "sentences" },
    lines.map((line) => el(line.includes("(k) = ") ? "code" : "p", {}, line.trim())),
    el("div", { class: "row exports" }, makeReportButtons(job)),
  );
}

/** Make the overview of the models of one output: `above` and `below` the note, and `front` that marks one. */
function makeOverview(job, models, unit, signal) {
  const front = makeModelFront(job, models, unit, signal);
  const islands = job.progress?.islands?.length ?? 0;
  return {
    front,
    above: [front.node, makeScrollable("Models", makeModelTable(job.id, models))],
    below: [
      ...listRefits(models.map((model) => ({ model, name: model.rank })), "Model "),
      makeCompareChoice(job, models) ?? "",
    ],
    figures: [makeSearchFigures(job.id, islands, signal)],
  };
}

/** Make the panel of the models; `select(rank)` shows a model, the recommended one for null. */
export function makeModelsPanel(job, rank, unit, signal) {
  const body = el("div", {}, el("p", { class: "loading" }, "Loading…"));
  const article = el("article", { class: "model", "aria-labelledby": "model" });
  const hasSeveralOutputs = Array.isArray(job.spec.output);
  let [models, names, front] = [[], null, null];
  let controller = new AbortController();

  function select(newRank) {
    rank = newRank;
    const model = models.find((each) => (newRank ? each.rank === newRank : each.recommended)) ?? models[0];
    if (!model || String(model.rank) === article.dataset.rank) return;
    controller.abort();
    controller = new AbortController();
    article.dataset.rank = model.rank;
    front?.show(model);
    const shown = AbortSignal.any([signal, controller.signal]);
    article.replaceChildren(...makeDetail(job, model, { hysteresis: claimHysteresis(models), names }, shown));
    for (const link of body.querySelectorAll("table.models a")) {
      const current = link.textContent === String(model.rank);
      link.closest("tr").classList.toggle("current", current);
      if (current) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
    }
  }

  poll(async () => {
    const path = getJobPath(job.id);
    models = (await getJson(`${path}/models`, { signal })).items;
    let overview = { above: [], below: [], figures: [] };
    if (hasSeveralOutputs) {
      const { outputs, record } = await getJson(`${path}/result`, { signal });
      names = record.names;
      overview.above = [makeScrollable("Outputs", makeOutputTable(outputs))];
    } else {
      overview = makeOverview(job, models, unit, signal);
      front = overview.front;
    }
    const note = el(
      "p",
      { class: "soft small" },
      "Errors are those of the free run. The models are ranked by the validation data, so these errors are "
        + "not an independent test.",
    );
    const { above, below, figures } = overview;
    body.replaceChildren(makeSentences(job), ...above, note, ...below, article, ...figures);
    select(rank);
    return Infinity;
  }, signal);
  return { node: el("section", { class: "card" }, el("h2", {}, "Models"), body), select };
}
