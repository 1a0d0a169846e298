/** Page of a data set: its signals, its columns, the facts about the record, and the start of a job. */

import { makeColumnChoice } from "../components/column_choice.js";
import { listFacts } from "../components/dataset.js";
import { makeRunForm } from "../components/run_form.js";
import { makeSignalPlot } from "../components/signal_plot.js";
import { getJson } from "../lib/api.js";
import { el, makeFacts } from "../lib/dom.js";
import { formatBytes, formatCount, formatShort } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";

const HINT = "Click, then wheel: zoom. Drag: move. Keys: arrows, +, −, Home.";

function makeContent(dataset, signal) {
  const { preview } = dataset;
  const form = makeRunForm(dataset);
  const plot = makeSignalPlot(dataset, form.setRows, signal);
  const choice = makeColumnChoice(preview, update);

  function update() {
    const { inputs, output } = choice.getChoice();
    form.show({ inputs, output });
    plot.show([...inputs, ...(output ? [output] : [])]);
  }

  // The plot has no width before the page contains it.
  requestAnimationFrame(update);
  const all = el("button", { type: "button", class: "quiet", on: { click: plot.showAll } }, "Show all rows");
  return [
    el(
      "section",
      { class: "card" },
      makeFacts([
        ["Rows", formatCount(preview.samples)],
        ["Sampling time", preview.dt === null ? "unknown" : `${formatShort(preview.dt)} s`],
        ["Time", preview.time],
        ["Size", formatBytes(dataset.bytes)],
      ]),
      ...preview.warnings.map((warning) => el("p", { class: "complaint" }, warning)),
    ),
    el(
      "section",
      { class: "card" },
      el(
        "div",
        { class: "heading" },
        el("h2", {}, "Signals"),
        el("span", { class: "soft small" }, HINT, all),
      ),
      plot.node,
    ),
    form.node,
    el("section", { class: "card" }, el("h2", {}, "Columns"), choice.node),
    preview.inspection &&
      el("section", { class: "card" }, el("h2", {}, "Facts"), listFacts(preview.inspection)),
  ].filter(Boolean);
}

/** Show a data set in a host until the signal aborts. */
export function mountDataset(host, { id }, signal) {
  const title = el("h1", { tabindex: "-1" }, "Data set");
  const body = el("div", { class: "stack" }, el("p", { class: "loading" }, "Loading…"));
  const back = el("a", { class: "back", href: "#/data" }, "← Data");
  host.replaceChildren(back, el("div", { class: "heading" }, title), body);
  document.title = "Data set · islands";
  poll(async () => {
    try {
      const dataset = await getJson(`v1/datasets/${encodeURIComponent(id)}`, { signal });
      title.replaceChildren(el("bdi", {}, dataset.name));
      document.title = `${dataset.name} · islands`;
      body.replaceChildren(...makeContent(dataset, signal));
    } catch (error) {
      if (error.status !== 404) throw error;
      body.replaceChildren(el("p", { class: "empty" }, error.message));
    }
    return Infinity;
  }, signal);
  return {};
}
