/** Best models of a search so far: the front of size against error, and the equation of a point. */

import { el, makeScrollable, setText } from "../lib/dom.js";
import { formatNumber, formatTerms } from "../lib/numbers.js";
import { makeLineChart } from "./chart.js";
import { makeLine } from "./equation.js";
import { letChoose } from "./point_choice.js";

/** Return the models of the front, smallest first; a search in many processes reports errors only. */
export function getFront({ front, best_by_size: best = {} } = {}) {
  if (front?.length) return front;
  const errors = Object.entries(best).map(([size, error]) => ({ size: Number(size), error }));
  return errors.filter(({ error }) => Number.isFinite(error)).sort((a, b) => a.size - b.size);
}

/** Error of the model that is shown unless another is chosen, relative to the least error, at most. */
const SHOWN_RATIO = 1.1;

/** Return the smallest model whose error is near the least one. */
export function findSmall(front) {
  const least = Math.min(...front.map((each) => each.error));
  return front.find((each) => each.error <= SHOWN_RATIO * least);
}

/** Make the panel; `show(job)` updates it. It is hidden before the first models, and with a result. */
export function makeLivePanel(unit) {
  const equation = el("code", { class: "plain" });
  const host = makeScrollable("Equation of the best model so far", equation);
  host.classList.add("equation");
  const statement = el("p", { class: "soft small" });
  let [front, size] = [[], null];
  const chart = makeLineChart({
    title: "Front of size against error",
    x: { label: "terms", integer: true },
    y: { label: unit ? `RMS error / ${unit}` : "RMS error", log: true },
    marks: true,
  });
  letChoose(chart, "shows the equation of a point", (at) => {
    size = at;
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
    el("h2", {}, "Best models so far"),
    el("div", { class: "live-model" }, host, statement, preliminary),
    chart.node,
  );

  function showModel() {
    const model = front.find((each) => each.size === size) ?? findSmall(front);
    const text = model.equation ?? "";
    host.hidden = !text;
    if (equation.textContent !== text) equation.replaceChildren(...makeLine(text));
    const which = model.size === size ? "Chosen point" : "Smallest model within 10 % of the least error";
    const error = `${formatNumber(model.error)} ${unit}`.trim();
    setText(statement, `${which}: ${formatTerms(model.size)}, error ${error}`);
    const points = front.map((each) => [each.size, each.error]);
    chart.draw([{ name: "least error", points }], [{ kind: "chosen", at: model.size }]);
  }

  return {
    node,
    show(job) {
      front = getFront(job.progress ?? {});
      node.hidden = front.length === 0 || job.state === "succeeded";
      if (node.hidden) return;
      showModel();
    },
  };
}
