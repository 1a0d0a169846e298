/** Convergence of a search: the error of each island by generation, and the last migration. */

import { getJobPath, getJson } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";
import { poll } from "../lib/polling.js";
import { COLOURS, makeLineChart } from "./chart.js";
import { makeIslandMap } from "./island_map.js";
import { isEnded } from "./job_state.js";

/** Maximum number of points kept; beyond it every other point is dropped. The chart has no more pixels. */
const MAX_POINTS = 600;

/** Seconds between two requests for the history without an event of the job. */
const REFRESH_SECONDS = 600;

/** Text in place of the chart before the first generation. */
const WAITING = "The error of the search is drawn from its first generation on.";

/** Convert a mean squared error of the service to an RMS error in the unit of the output. */
const toRms = (error) => (Number.isFinite(error) ? Math.sqrt(error) : null);

/** Return every other point and the last one. */
export const halve = (points) => points.filter((_, at) => at % 2 === 0 || at === points.length - 1);

/** Return the RMS errors of the islands at a point, then the best and the worst of them. */
function listErrors({ islands }) {
  const finite = islands.filter(Number.isFinite);
  const ends = finite.length ? [Math.min(...finite), Math.max(...finite)] : [null, null];
  return [...islands, ...ends].map(toRms);
}

/**
 * Make the errors of the islands over the generations: `add(points)` appends points of the service,
 * `getLast()` returns the last generation, -1 at first, and `list()` the series of a chart: one of each
 * island, and the best and the worst if there are more islands than colours.
 */
export function makeIslandErrors() {
  // A list of each series: an event adds one number to each, and the rest is not computed again.
  let [generations, errors] = [[], []];
  return {
    add(points) {
      for (const point of points) {
        generations.push(point.generation);
        listErrors(point).forEach((error, at) => (errors[at] ??= []).push(error));
      }
      while (generations.length > MAX_POINTS) [generations, ...errors] = [generations, ...errors].map(halve);
    },
    getLast: () => generations.at(-1) ?? -1,
    list() {
      // The chart keeps its series, and later points are added here.
      const x = [...generations];
      const islands = Math.max(0, errors.length - 2);
      const faint = islands > COLOURS;
      const names = errors.map((_, at) => `island ${at + 1}`);
      names.splice(islands, 2, `best of ${islands} islands`, `worst of ${islands} islands`);
      return errors
        .map((y, at) => ({ name: names[at], x, y, faint: faint && at < islands }))
        .slice(0, faint ? islands + 2 : islands);
    },
  };
}

/** Make the panel of a job; `draw(job)` loads and draws the errors up to now, `show(job)` the rest. */
export function makeConvergencePanel(id, unit, signal) {
  const label = unit ? `RMS error / ${unit}` : "RMS error";
  const islands = makeLineChart({
    title: "Error of each island",
    x: { label: "generation", integer: true },
    y: { label, log: true },
  }, signal);
  const map = makeIslandMap(unit);
  const placeholder = el("p", { class: "soft" });
  const errors = makeIslandErrors();
  let targetGeneration = -1;
  let loadNow = null;

  async function load() {
    let hasMore = false;
    while (errors.getLast() < targetGeneration && !signal.aborted) {
      const path = `${getJobPath(id)}/history?after=${errors.getLast()}`;
      const { items } = await getJson(path, { signal });
      if (items.length === 0) break;
      errors.add(items);
      hasMore = true;
    }
    if (hasMore) {
      placeholder.hidden = true;
      islands.draw(errors.list());
    }
    return REFRESH_SECONDS;
  }

  return {
    node: el(
      "section",
      { class: "card" },
      el("h2", {}, "Convergence of the search"),
      placeholder,
      el("div", { class: "convergence" }, islands.node, map.node),
    ),
    draw({ progress }) {
      const generation = progress?.generation ?? -1;
      if (generation === targetGeneration && errors.getLast() >= generation) return;
      targetGeneration = generation;
      if (loadNow === null) loadNow = poll(load, signal);
      else loadNow();
    },
    show(job) {
      map.show(job.progress ?? {});
      setText(placeholder, isEnded(job) ? "The search ended before its first generation." : WAITING);
    },
  };
}
