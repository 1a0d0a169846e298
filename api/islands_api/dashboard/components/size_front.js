/** Fronts of size against error: of a running search with its equations, and of a finished job. */

import { el, makeScrollable, setText } from "../lib/dom.js";
import { formatNumber, formatSize, nameParts } from "../lib/numbers.js";
import { makeLineChart } from "./chart.js";
import { makeLine } from "./equation.js";
import { getModelClass, isEnded } from "./job_state.js";
import { makeSearchRun } from "./search_run.js";

/** Make a chart of errors by size; `getKind()` returns the class of the models. */
const makeChart = (title, error, unit, getKind, signal) =>
  makeLineChart({
    title,
    x: { get label() { return nameParts(getKind()); }, integer: true },
    y: { label: unit ? `${error} / ${unit}` : error, log: true },
    marks: true,
  }, signal);

/** Call `choose(x)` for a chosen point of a line chart; `chooses` says to screen readers what that does. */
function letChoose(chart, chooses, choose) {
  const plot = chart.node.querySelector(".plot");
  plot.classList.add("choosing");
  plot.setAttribute("aria-description", `Enter ${chooses}.`);
  const chooseNow = () => choose(Number(plot.getAttribute("aria-valuenow")));
  plot.addEventListener("click", ({ clientX }) => {
    // A touch has moved no pointer before.
    plot.dispatchEvent(new PointerEvent("pointermove", { clientX }));
    chooseNow();
  });
  plot.addEventListener("keydown", ({ key }) => {
    if (key === "Enter") chooseNow();
  });
}

/** Return the models of the front, smallest first; before the first front there are errors only. */
function getFront({ front, best_by_size: best = {} } = {}) {
  if (front?.length) return front;
  const errors = Object.entries(best).map(([size, error]) => ({ size: Number(size), error }));
  return errors.filter(({ error }) => Number.isFinite(error)).sort((a, b) => a.size - b.size);
}

/**
 * Make the panel; `draw(job)` updates its chart, and then `show(job)` the rest. It is hidden before the first
 * models, and with a result.
 */
export function makeLivePanel(job, unit, signal) {
  const equation = el("code", { class: "plain" });
  const host = makeScrollable("Equation of the best model so far", equation);
  host.classList.add("equation");
  const heading = el("h2");
  const statement = el("p", { class: "soft small" });
  let [front, size, simulated, kind] = [[], null, null, getModelClass(job)];
  const run = makeSearchRun(job, unit, signal);
  const chart = makeChart("Front of size against error", "RMS error", unit, () => kind, signal);
  letChoose(chart, "shows the equation of a point", (at) => {
    size = at;
    drawFront();
    showModel();
  });
  const preliminary = el(
    "p",
    { class: "soft small" },
    "These are models of the running search. The final estimation changes their parameters, and the "
      + "validation data choose among them.",
  );
  const node = el(
    "section",
    { class: "card live", hidden: true },
    heading,
    el("div", { class: "live-model" }, host, statement, preliminary),
    chart.node,
    run.node,
  );

  const findSize = (wanted) => front.find((each) => each.size === wanted);
  const findModel = () => findSize(size) ?? findSize(simulated) ?? front.at(-1);

  function drawFront() {
    const [x, y] = [front.map((each) => each.size), front.map((each) => each.error)];
    chart.draw([{ name: "least error", x, y }], [{ kind: "chosen", at: findModel().size }]);
  }

  function showModel() {
    const model = findModel();
    const text = model.equation ?? "";
    host.hidden = !text;
    if (equation.textContent !== text) equation.replaceChildren(...makeLine(text));
    let which = model === front.at(-1) ? "Model of the least error" : "Smallest model near the least error";
    if (model.size === size) which = "Chosen point";
    const error = `${formatNumber(model.error)} ${unit}`.trim();
    setText(statement, `${which}: ${formatSize(model.size, kind)}, error ${error}`);
  }

  return {
    node,
    draw({ spec, progress }) {
      kind = getModelClass({ spec, progress });
      front = getFront(progress ?? {});
      simulated = progress?.free_run?.size;
      if (front.length) drawFront();
    },
    show(job) {
      const { progress, state } = job;
      node.hidden = front.length === 0 || state === "succeeded";
      preliminary.hidden = state !== "running";
      setText(heading, isEnded(job) ? "Best models when the search ended" : "Best models so far");
      if (node.hidden) return;
      showModel();
      run.show(progress.free_run);
    },
  };
}

/** Errors of the free run, on both parts of the record. */
const PARTS = ["validation", "estimation"];

/** Make the series of the errors of models by size; of several models of a size the best one counts. */
function makeFrontSeries(models) {
  const bySize = new Map(models.toReversed().map((model) => [model.size, model]));
  const sorted = [...bySize.values()].sort((a, b) => a.size - b.size);
  return PARTS.map((part) => ({
    name: part,
    x: sorted.map(({ size }) => size),
    y: sorted.map(({ metrics }) => metrics[part].free_run.rmse),
  }));
}

/** Make the chart with the equation of a model; `show(model)` marks another model. */
export function makeModelFront(job, models, unit, signal) {
  const [statement, equation] = [el("p", {}), el("code", { class: "plain" })];
  const chart = makeChart("Size against error", "RMSE of the free run", unit, () => models[0].kind, signal);
  letChoose(chart, "opens the model of a point", (size) => {
    const { rank } = models.find((model) => model.size === size);
    location.hash = `#/jobs/${job.id}/models/${rank}`;
  });
  const host = makeScrollable("Equation of the point", equation);
  host.classList.add("equation");
  return {
    node: el("div", { class: "front" }, chart.node, el("div", { class: "live-model" }, statement, host)),
    show(model) {
      const { rmse } = model.metrics.validation.free_run;
      const error = Number.isFinite(rmse) ? `RMSE ${formatNumber(rmse)} ${unit}`.trim() : "diverged";
      setText(statement, `Model ${model.rank}: ${formatSize(model.size, model.kind)}, ${error}`);
      equation.replaceChildren(...makeLine(model.equation));
      chart.draw(makeFrontSeries(models), [{ kind: "chosen", at: model.size }]);
    },
  };
}
