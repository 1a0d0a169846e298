/** Page of a data set: its signals, its columns, the facts about the record, and the start of a job. */

import { makeColumnChoice } from "../components/column_choice.js";
import { listFacts } from "../components/dataset.js";
import { makeDiagnosisForm } from "../components/diagnosing/diagnosis_form.js";
import { makeRunForm } from "../components/run_form.js";
import { HINT, makeSignalPlot } from "../components/signal_plot.js";
import { getJson } from "../lib/api.js";
import { el, makeFacts } from "../lib/dom.js";
import { formatBytes, formatCount, formatShort } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";

/** Return the function that requests columns of a data set for a plot. */
const askDataset = (id, signal) => (query, names) => {
  for (const name of names) query.append("column", name);
  return getJson(`v1/datasets/${encodeURIComponent(id)}/samples?${query}`, { signal });
};

function makeContent(dataset, signal) {
  const { preview } = dataset;
  const units = Object.fromEntries(preview.columns.map(({ name, unit }) => [name, unit]));
  const makeLine = (name, colour) => ({ name, unit: units[name], colour });
  let simulated = null;
  const forms = [makeRunForm(dataset), makeDiagnosisForm(dataset, showSimulated, signal)];
  const setRows = (rows) => forms.forEach((form) => form.setRows(rows));
  const plot = makeSignalPlot({ ...preview, ask: askDataset(dataset.id, signal) }, setRows, signal);
  const choice = makeColumnChoice(preview, update);

  function showSignals() {
    const { inputs, output } = choice.getChoice();
    const measured = simulated
      ? [makeLine(output, "ink"), makeLine(simulated, "before")]
      : [makeLine(output)];
    plot.show([...inputs.map((name) => [makeLine(name)]), ...(output ? [measured] : [])]);
  }

  /** Draw a recorded simulation over the measured output. */
  function showSimulated(column) {
    simulated = column;
    showSignals();
  }

  function update() {
    forms.forEach((form) => form.show(choice.getChoice()));
    showSignals();
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
    ...forms.map((form) => form.node),
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
