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

/** Make one series per island, plus the best and the worst if there are more islands than colours. */
export function makeIslandSeries(points) {
  const islands = points.at(-1)?.islands.length ?? 0;
  const series = Array.from({ length: islands }, (_, island) => ({
    name: `island ${island + 1}`,
    points: points.map((point) => [point.generation, toRms(point.islands[island])]),
    faint: islands > COLOURS,
  }));
  if (islands <= COLOURS) return series;
  const makeEnvelope = (name, select) => ({
    name: `${name} of ${islands} islands`,
    points: points.map(({ generation, islands: errors }) => {
      const finite = errors.filter(Number.isFinite);
      return [generation, finite.length ? toRms(finite.reduce((a, b) => select(a, b))) : null];
    }),
  });
  return [...series, makeEnvelope("best", Math.min), makeEnvelope("worst", Math.max)];
}

/** Return every other point and the last one. */
export const halve = (points) => points.filter((_, at) => at % 2 === 0 || at === points.length - 1);

/** Make the panel of a job; `advance(job)` loads the history up to the generation of the job. */
export function makeConvergencePanel(id, unit, signal) {
  const label = unit ? `RMS error / ${unit}` : "RMS error";
  const islands = makeLineChart({
    title: "Error of each island",
    x: { label: "generation", integer: true },
    y: { label, log: true },
  });
  const map = makeIslandMap(unit);
  const placeholder = el("p", { class: "soft" });
  let points = [];
  let targetGeneration = -1;
  let loadNow = null;

  async function load() {
    let hasMore = false;
    while ((points.at(-1)?.generation ?? -1) < targetGeneration && !signal.aborted) {
      const after = points.at(-1)?.generation ?? -1;
      const { items } = await getJson(`${getJobPath(id)}/history?after=${after}`, { signal });
      if (items.length === 0) break;
      points = points.concat(items);
      while (points.length > MAX_POINTS) points = halve(points);
      hasMore = true;
    }
    if (hasMore) {
      placeholder.hidden = true;
      islands.draw(makeIslandSeries(points));
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
    advance(job) {
      map.show(job.progress ?? {});
      setText(placeholder, isEnded(job) ? "The search ended before its first generation." : WAITING);
      targetGeneration = job.progress?.generation ?? -1;
      if (targetGeneration < 0) return;
      if (loadNow === null) loadNow = poll(load, signal);
      else loadNow();
    },
  };
}
