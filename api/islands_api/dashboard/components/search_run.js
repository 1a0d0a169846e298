/** Free run of the best model so far of a running search, over the measured output. */

import { getJobPath, getJson } from "../lib/api.js";
import { el, setText } from "../lib/dom.js";
import { formatCount, formatShort, formatSize } from "../lib/numbers.js";
import { makeLineChart } from "./chart.js";

/** Return the points of a signal, with the least and the greatest value of every part. */
function listPoints({ rows, start, dt, samples }, { minimum, maximum }) {
  const times = rows.map((row) => start + row * dt);
  if (rows.length === samples) return { x: times, y: minimum };
  return {
    x: times.flatMap((at) => [at, at]),
    // The line enters a part at one extreme and leaves it at the other.
    y: minimum.flatMap((low, part) => (part % 2 ? [maximum[part], low] : [low, maximum[part]])),
  };
}

/** Make the chart; `show(mark)` loads the free run when its mark in the progress of the job has changed. */
export function makeSearchRun(job, unit, signal) {
  const chart = makeLineChart({
    title: "Free run of the best model so far",
    x: { label: "time (s)", describe: (at) => `${formatShort(at)} s` },
    y: { label: [job.spec.output, unit && `(${unit})`].filter(Boolean).join(" ") },
  }, signal);
  const statement = el("p", { class: "soft small" });
  const node = el("div", { class: "search-run", hidden: true }, chart.node, statement);
  let [shown, wanted, isLoading] = [null, null, false];

  /** Load the newest free run. While one loads, later marks make one further request. */
  async function load() {
    isLoading = true;
    while (wanted !== shown && !signal.aborted) {
      const mark = wanted;
      try {
        draw(await getJson(`${getJobPath(job.id)}/free-run`, { signal }));
      } catch (error) {
        // The search may have ended: its result replaces the free run.
        if (!signal.aborted) setText(statement, error.message);
      }
      shown = mark;
    }
    isLoading = false;
  }

  function draw(found) {
    chart.draw(
      found.outputs.map((each) => ({ name: each.name.replace("_", " "), ...listPoints(found, each) })),
    );
    const outcome = found.outcome === "ok" ? "" : ` (${found.outcome})`;
    setText(
      statement,
      `${formatSize(found.size, found.kind)}, generation ${formatCount(found.generation)}, over the `
        + `estimation data${outcome}. It is the smallest model within 10 % of the least error.`,
    );
    node.hidden = false;
  }

  return {
    node,
    show(mark) {
      if (!mark) return;
      wanted = `${mark.generation}/${mark.size}`;
      if (!isLoading) load();
    },
  };
}
