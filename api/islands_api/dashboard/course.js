/** The course of a search: the error of every island over generations, and the best of every size. */

import { json } from "./api.js";
import { COLOURS, lineChart } from "./chart.js";
import { el } from "./dom.js";
import { repeat } from "./watch.js";

/** Points that are kept: a screen shows no more. Beyond that every other one is let go. */
const MOST = 4000;

/** Seconds until the history is looked at again though nothing was said of it. */
const SELDOM = 600;

/** The service keeps mean squared errors; people read errors in the output's unit. */
const root = (error) => (Number.isFinite(error) ? Math.sqrt(error) : null);

/** Return the lines of a history: one for each island, or the best and worst where there are too many. */
export function islandSeries(points) {
  const islands = points.at(-1)?.islands.length ?? 0;
  const each = Array.from({ length: islands }, (_, island) => ({
    name: `island ${island + 1}`,
    points: points.map((point) => [point.generation, root(point.islands[island])]),
    faint: islands > COLOURS,
  }));
  if (islands <= COLOURS) return each;
  const over = (name, choose) => ({
    name: `${name} of ${islands} islands`,
    points: points.map(({ generation, islands: errors }) => {
      const found = errors.filter(Number.isFinite);
      return [generation, found.length ? root(found.reduce((a, b) => choose(a, b))) : null];
    }),
  });
  return [...each, over("best", Math.min), over("worst", Math.max)];
}

/** Return the line of the best error of every size at the history's end. */
export function sizeSeries(points) {
  const best = Object.entries(points.at(-1)?.best ?? {}).map(([size, error]) => [Number(size), root(error)]);
  return [{ name: "best so far", points: best.sort(([a], [b]) => a - b) }];
}

/** Every other point, and the last one. */
export const halved = (points) => points.filter((_, at) => at % 2 === 0 || at === points.length - 1);

/** Show a job's course; `advance(job)` brings it up to where the job is. */
export function course(id, unit, signal) {
  const label = unit ? `RMS error / ${unit}` : "RMS error";
  const islands = lineChart({
    title: "Error of every island",
    x: { label: "generation", whole: true },
    y: { label, log: true },
  });
  const sizes = lineChart({
    title: "Best error by number of terms",
    x: { label: "terms", whole: true },
    y: { label, log: true },
    marks: true,
  });
  const waiting = el("p", { class: "soft" }, "There is nothing to see before the first generation.");
  let points = [];
  let wanted = -1;
  let hurry = null;

  async function load() {
    while ((points.at(-1)?.generation ?? -1) < wanted && !signal.aborted) {
      const after = points.at(-1)?.generation ?? -1;
      const { items } = await json(`v1/jobs/${encodeURIComponent(id)}/history?after=${after}`, { signal });
      if (items.length === 0) break;
      points = points.concat(items);
      while (points.length > MOST) points = halved(points);
      waiting.hidden = true;
      islands.draw(islandSeries(points));
      sizes.draw(sizeSeries(points));
    }
    return SELDOM;
  }

  return {
    node: el(
      "section",
      { class: "card" },
      el("h2", {}, "Course of the search"),
      waiting,
      el("div", { class: "course" }, islands.node, sizes.node),
    ),
    advance(job) {
      wanted = job.progress?.generation ?? -1;
      if (wanted < 0) return;
      if (hurry === null) hurry = repeat(load, signal);
      else hurry();
    },
  };
}
