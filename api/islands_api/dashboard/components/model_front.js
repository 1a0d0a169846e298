/** Front of the models of a finished job: size against error, where each point opens its model. */

import { el, makeScrollable, setText } from "../lib/dom.js";
import { formatNumber, formatTerms } from "../lib/numbers.js";
import { makeLineChart } from "./chart.js";
import { makeLine } from "./equation.js";
import { letChoose } from "./point_choice.js";

/** Errors of the free run, on both parts of the record. */
const PARTS = ["validation", "estimation"];

/** Make the series of the errors of models by size; of several models of a size the best one counts. */
export function makeFrontSeries(models) {
  const bySize = new Map(models.toReversed().map((model) => [model.size, model]));
  const sorted = [...bySize.values()].sort((a, b) => a.size - b.size);
  return PARTS.map((part) => ({
    name: part,
    points: sorted.map((model) => [model.size, model.metrics[part].free_run.rmse]),
  }));
}

/** Make the chart with the equation of a model; `show(model)` marks another model. */
export function makeModelFront(job, models, unit) {
  const [statement, equation] = [el("p", {}), el("code", { class: "plain" })];
  const chart = makeLineChart({
    title: "Size against error",
    x: { label: "terms", integer: true },
    y: { label: unit ? `RMSE of the free run / ${unit}` : "RMSE of the free run", log: true },
    marks: true,
  });
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
      setText(statement, `Model ${model.rank}: ${formatTerms(model.size)}, ${error}`);
      equation.replaceChildren(...makeLine(model.equation));
      chart.draw(makeFrontSeries(models), [{ kind: "chosen", at: model.size }]);
    },
  };
}
