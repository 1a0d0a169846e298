/** The models of a job that has succeeded: how good they are, what they say, and how to take them along. */

import { download, json } from "./api.js";
import { complain } from "./banner.js";
import { el, facts, once, scrolled, table } from "./dom.js";
import { equationOf } from "./equation.js";
import { figure } from "./figures.js";
import { NONE, number, percent, short } from "./numbers.js";
import { repeat } from "./watch.js";

/** Kinds of export, as people call them. */
const EXPORTS = {
  python: "Python",
  c: "C",
  matlab: "MATLAB",
  latex: "LaTeX",
  mathml: "MathML",
  plain: "Text",
  json: "JSON",
};

const PARTS = ["estimation", "validation"];

/** Write a number that can be had in full: the value of the element is as the service gave it. */
function exact(value, written) {
  if (typeof value !== "number") return NONE;
  return el("data", { value: String(value), title: String(value) }, written(value));
}

const r2 = (value) => (Math.abs(value) < 100 ? value.toFixed(5).replace("-", "−") : number(value));

/** A metric of the free run; where it diverged, that word says more than no number. */
function metric(model, part, name, written) {
  const value = model.metrics[part].free_run[name];
  const outcome = model.outcomes[part].free_run;
  return value === null && outcome !== "ok" ? el("span", { class: "no" }, outcome) : exact(value, written);
}

const HEADINGS = [
  ...["Rank", "Terms", "MAPE est. %", "R² est.", "MAPE val. %", "R² val."],
  ...["Hold drift %", "Property 1", "Residuals"],
];

const verdict = (good, yes, no) => el("span", { class: good ? "yes" : "no" }, good ? yes : no);

function row(job, model) {
  const { rank, physics, residual_tests: residuals } = model;
  const drift = physics.hold_drift_percent;
  const passed = residuals.tests.filter((test) => test.passed).length;
  return [
    el("a", { href: `#/jobs/${job}/models/${rank}`, "aria-label": `Model ${rank}` }, String(rank)),
    String(model.size),
    ...PARTS.flatMap((part) => [metric(model, part, "mape", number), metric(model, part, "r2", r2)]),
    drift === null ? el("span", { class: "no" }, "diverged") : exact(drift, number),
    verdict(physics.property_1, "holds", "fails"),
    verdict(residuals.passed, "pass", `${passed} of ${residuals.tests.length}`),
  ];
}

function overview(job, models) {
  const named = HEADINGS.map((name, at) => [name, at === 0 ? null : "figure"]);
  const rows = models.map((model) => row(job, model));
  const made = table("Models, best on the validation data first", named, rows);
  made.classList.add("models");
  return made;
}

function terms(model) {
  return table(
    "Terms of the model",
    ["Regressor", ["Parameter", "figure"], ["Standard error", "figure"]],
    model.terms.map((term) => [
      el("code", {}, term.regressor),
      exact(term.parameter, (value) => number(value, 6)),
      exact(term.standard_error, number),
    ]),
  );
}

/** Names of residual tests as the literature writes them. */
const greek = (name) => name.replaceAll("xi", "ξ").replaceAll("2", "²").replaceAll("_", " ");

function residuals({ residual_tests: { tests } }) {
  return table(
    "Residual tests",
    ["Correlation", ["Inside its limits", "figure"], ["Largest", "figure"], ["Limit", "figure"], "Verdict"],
    tests.map((test) => [
      test.input === null ? greek(test.name) : `${greek(test.name)}, input ${test.input + 1}`,
      percent(test.inside_percent),
      number(test.largest),
      number(test.limit),
      test.note || verdict(test.passed, "pass", "fail"),
    ]),
  );
}

const wanted = (target) => (typeof target === "number" ? `, wanted ${short(target)}` : "");

const sum = ({ cluster, sum: found, target }) => [
  `Sum of cluster ${cluster}`,
  `${short(found)}${wanted(target)}`,
];

const excursion = ({ name, bounded, range_percent: range }) => [
  `Range, ${name}`,
  bounded ? percent(range) : el("span", { class: "no" }, "diverges"),
];

function exportButtons(path, rank) {
  const save = (form) =>
    once(() => download(`${path}/export?format=${form}`, `model-${rank}.txt`).catch(complain));
  return Object.entries(EXPORTS).map(([form, name]) =>
    el("button", { type: "button", "data-format": form, on: { click: save(form) } }, name));
}

function equation(path, model, signal) {
  const host = scrolled("Equation", el("code", { class: "plain" }, model.equation));
  host.classList.add("equation");
  equationOf(path, signal).then(
    (math) => host.replaceChildren(math),
    // The plain form stays; what is wrong is told.
    (error) => signal.aborted || complain(error),
  );
  return host;
}

function gallery(path, signal, skip = () => false) {
  const host = el("div", { class: "gallery" });
  repeat(async () => {
    const { items } = await json(`${path}/figures`, { signal });
    const names = items.filter((name) => !skip(name));
    host.replaceChildren(...names.map((name) => figure(`${path}/figures`, name, signal)));
    return Infinity;
  }, signal);
  return host;
}

function detail(job, model, signal) {
  const path = `v1/jobs/${encodeURIComponent(job)}/models/${model.rank}`;
  const { physics, information } = model;
  return [
    el("h3", { id: "model" }, `Model ${model.rank}`),
    equation(path, model, signal),
    el(
      "div",
      { class: "row take", role: "group", "aria-label": "Take the model with you as" },
      el("span", { class: "soft", "aria-hidden": "true" }, "Take it with you as"),
      exportButtons(path, model.rank),
    ),
    el(
      "div",
      { class: "pair" },
      el("div", {}, el("h4", {}, "Terms"), scrolled("Terms", terms(model))),
      el("div", {}, el("h4", {}, "Residual tests"), scrolled("Residual tests", residuals(model))),
    ),
    facts([
      ...physics.clusters.map(sum),
      ...physics.excursions.map(excursion),
      ["AIC", number(information.aic, 6)],
      ["BIC", number(information.bic, 6)],
    ]),
    gallery(path, signal),
  ];
}

/** The figures of the search as a whole, drawn once they are wanted. */
function searchFigures(job, islands, signal) {
  const path = `v1/jobs/${encodeURIComponent(job)}`;
  const title = el("summary", {}, "Record, front and convergence, as figures for a report");
  const node = el("details", { class: "search" }, title);
  // A single island has no course beside others.
  const open = () => node.append(gallery(path, signal, (name) => name === "islands" && islands < 2));
  node.addEventListener("toggle", open, { once: true });
  return node;
}

/** Show the models of a job; `select(rank)` shows one in full, the best one for null. */
export function modelsPanel(job, rank, signal) {
  const body = el("div", {}, el("p", { class: "waiting" }, "Asking the service…"));
  const shown = el("article", { class: "model", "aria-labelledby": "model" });
  let models = [];
  let end = new AbortController();

  function select(wanted) {
    rank = wanted;
    const model = models.find((each) => each.rank === (wanted ?? 1)) ?? models[0];
    if (!model || String(model.rank) === shown.dataset.rank) return;
    end.abort();
    end = new AbortController();
    shown.dataset.rank = model.rank;
    shown.replaceChildren(...detail(job.id, model, AbortSignal.any([signal, end.signal])));
    for (const link of body.querySelectorAll("table.models a")) {
      const current = link.textContent === String(model.rank);
      link.closest("tr").classList.toggle("current", current);
      if (current) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
    }
  }

  repeat(async () => {
    models = (await json(`v1/jobs/${encodeURIComponent(job.id)}/models`, { signal })).items;
    const note = el(
      "p",
      { class: "soft small" },
      "Errors are those of the free run; the validation data chose the order, so they are no test.",
    );
    const table = scrolled("Models", overview(job.id, models));
    const islands = job.progress?.islands?.length ?? 0;
    body.replaceChildren(table, note, shown, searchFigures(job.id, islands, signal));
    select(rank);
    return Infinity;
  }, signal);
  return { node: el("section", { class: "card" }, el("h2", {}, "Models"), body), select };
}
