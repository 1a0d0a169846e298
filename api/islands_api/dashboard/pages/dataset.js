/** Page of a data set: its signals, its columns, the facts about the record, and the start of a job. */

import { clearBanner, showNotice, showProblem } from "../components/banner.js";
import { makeColumnChoice } from "../components/column_choice.js";
import { listFacts } from "../components/dataset.js";
import { makeDiagnosisForm } from "../components/diagnosing/diagnosis_form.js";
import { makeRecordNotes } from "../components/record_notes.js";
import { makeRowRanges } from "../components/row_ranges.js";
import { makeRunForm } from "../components/run_form.js";
import { HINT, makeSignalPlot } from "../components/signal_plot.js";
import { getDatasetPath, getJobPath, getJson, postJson } from "../lib/api.js";
import { announce, el, makeFacts } from "../lib/dom.js";
import { formatBytes, formatCount, formatShort } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";

/** What a drag in the plot does. */
const DRAGS = [
  ["Move", null],
  ["Mark estimation", "estimation"],
  ["Mark validation", "validation"],
];


/** Return the function that requests columns of a data set for a plot. */
const askDataset = (id, signal) => (query, names) => {
  for (const name of names) query.append("column", name);
  return getJson(`${getDatasetPath(id)}/samples?${query}`, { signal });
};

/** Read the record in another way, and open the page of that data set with the same choices. */
async function readAgain(dataset, reading, choices) {
  clearBanner("problem");
  showNotice("Reading the record…");
  try {
    const { id } = await postJson(`${getDatasetPath(dataset.id)}/readings`, { reading });
    const { dataset: _, validation, ...others } = choices;
    const isOwn = typeof validation === "object" && validation.dataset === dataset.id;
    const moved = isOwn ? { ...validation, dataset: id } : validation;
    const request = JSON.stringify({ ...others, ...(moved !== undefined && { validation: moved }) });
    location.hash = `#/data/${id}?${new URLSearchParams({ request })}`;
    announce("The record was read again");
  } catch (error) {
    showProblem(error);
  } finally {
    clearBanner("notice");
  }
}

/** Make the choice of what a drag does. */
function makeDragChoice(mark) {
  const buttons = DRAGS.map(([text, kind]) =>
    el("button", { type: "button", on: { click: () => choose(kind) } }, text),
  );
  function choose(chosen) {
    mark(chosen);
    buttons.forEach((button, at) => button.setAttribute("aria-pressed", String(DRAGS[at][1] === chosen)));
  }
  choose(null);
  return el("div", { class: "row drags", role: "group", "aria-label": "Dragging in the plot" }, buttons);
}

function makeSignalCard(plot, ranges) {
  const button = (text, click) => el("button", { type: "button", class: "quiet", on: { click } }, text);
  return el(
    "section",
    { class: "card" },
    el("div", { class: "heading" }, el("h2", {}, "Signals"), makeDragChoice(plot.mark)),
    plot.node,
    el(
      "div",
      { class: "row" },
      el("span", { class: "soft small" }, HINT),
      button("Show all rows", plot.showAll),
      button("Use only the visible rows", () => ranges.use(plot.getVisibleRows())),
    ),
    ranges.node,
  );
}

function makeContent(dataset, initial, signal) {
  const { preview } = dataset;
  const { samples, reading = {} } = preview;
  const units = Object.fromEntries(preview.columns.map(({ name, unit }) => [name, unit]));
  const makeLine = (name, colour) => ({ name, unit: units[name], colour });
  // A record with gaps has a usual step.
  const dt = preview.dt ?? preview.inspection?.sampling?.dt ?? null;
  // Rows of a record that is resampled, or that has gaps, are not equally spaced by its sampling time.
  const step = reading.resample || reading.gaps ? null : preview.dt;
  let [plot, form, simulated] = [null, null, null];
  const ranges = makeRowRanges(dataset.id, samples, initial, () => {
    plot?.draw();
    form?.update();
  });
  plot = makeSignalPlot({ samples, dt: step, ask: askDataset(dataset.id, signal) }, ranges, signal);
  form = makeRunForm(dataset, initial, ranges, signal);
  const again = initial.diagnosis ?? {};
  const diagnosis = makeDiagnosisForm(dataset, again, plot.getVisibleRows, showSimulated, signal);
  const choice = makeColumnChoice(preview, initial, update);

  function showSignals() {
    const columns = choice.listColumns();
    const panels = columns.map((name) => [makeLine(name)]);
    if (simulated && choice.getChoice().output)
      panels.splice(-1, 1, [makeLine(columns.at(-1), "ink"), makeLine(simulated, "before")]);
    plot.show(panels);
  }

  /** Draw a recorded simulation over the measured output. */
  function showSimulated(column) {
    simulated = column;
    showSignals();
  }

  function update() {
    form.show(choice.getChoice());
    diagnosis.show(choice.getChoice());
    showSignals();
  }

  // The plot has no width before the page contains it.
  requestAnimationFrame(() => {
    update();
    ranges.show();
  });
  const notes = makeRecordNotes(preview, {
    read: (reading) => readAgain(dataset, reading, form.getRequest()),
    setSamplingTime: form.setSamplingTime,
    showRows: plot.showRows,
  });
  return [
    el(
      "section",
      { class: "card", "aria-label": "Record" },
      makeFacts([
        ["Rows", formatCount(preview.samples)],
        ["Sampling time", dt === null ? "unknown" : `${formatShort(dt)} s`],
        ["Time column", preview.time],
        ["Size", formatBytes(dataset.bytes)],
      ]),
      notes,
    ),
    makeSignalCard(plot, ranges),
    form.node,
    diagnosis.node,
    el("section", { class: "card" }, el("h2", {}, "Columns"), choice.node),
    preview.inspection &&
      el("section", { class: "card" }, el("h2", {}, "Facts"), listFacts(preview.inspection, true)),
  ].filter(Boolean);
}

/** Return the request of an address that a reading of the record has kept; none if it is not JSON. */
function parseRequest(text) {
  try {
    return JSON.parse(text) ?? {};
  } catch {
    return {};
  }
}

/** Return the fields of a request that an address sets: those of a job, of another reading, or of a drop. */
async function loadInitial({ job, request, together }, signal) {
  if (request) return parseRequest(request);
  if (job) {
    const { kind, spec, name } = await getJson(getJobPath(job), { signal });
    if (kind !== "discrepancy") return { preset: "auto", ...spec, name };
    const { input, channels = [], output } = spec;
    return { inputs: [input, ...channels], output, diagnosis: { ...spec, name } };
  }
  if (!together) return {};
  const others = together.split(",").map((each) => getJson(getDatasetPath(each), { signal }));
  return { recordings: (await Promise.all(others)).map(({ id, name }) => ({ dataset: id, name })) };
}

/** Show a data set in a host until the signal aborts. */
export function mountDataset(host, { id, ...query }, signal) {
  const title = el("h1", { tabindex: "-1" }, "Data set");
  const body = el("div", { class: "stack" }, el("p", { class: "loading" }, "Loading…"));
  const back = el("a", { class: "back", href: "#/data" }, "← Data");
  host.replaceChildren(back, el("div", { class: "heading" }, title), body);
  document.title = "Data set · islands";
  poll(async () => {
    try {
      const [dataset, initial] = await Promise.all([
        getJson(getDatasetPath(id), { signal }),
        loadInitial(query, signal),
      ]);
      title.replaceChildren(el("bdi", {}, dataset.name));
      document.title = `${dataset.name} · islands`;
      body.replaceChildren(...makeContent(dataset, initial, signal));
    } catch (error) {
      if (error.status !== 404) throw error;
      body.replaceChildren(el("p", { class: "empty" }, error.message));
    }
    return Infinity;
  }, signal);
  return {};
}
