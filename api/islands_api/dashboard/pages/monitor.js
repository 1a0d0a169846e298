/** Page of a monitor: status, alarms, states of the effects over the records, records, settings. */

import { clearBanner, showProblem } from "../components/banner.js";
import { askConfirmation } from "../components/confirm.js";
import { formatSimulation } from "../components/dataset.js";
import {
  getIsolatedMonitorName,
  getMonitorName,
  makeStatusBadge,
} from "../components/monitoring/monitor_status.js";
import { makeRecordHistory } from "../components/monitoring/record_history.js";
import { makeAlarmsPanel, makeRecordsPanel } from "../components/monitoring/record_table.js";
import { makeRecordUpload } from "../components/monitoring/record_upload.js";
import { makeStatesPanel } from "../components/monitoring/state_charts.js";
import { download, sendRequest } from "../lib/api.js";
import { makeAge } from "../lib/clock.js";
import { announce, el, makeFacts, runOnceAtATime, setText } from "../lib/dom.js";
import { formatCount, formatDuration, formatShort } from "../lib/numbers.js";
import { followMonitor } from "../lib/polling.js";

function makeMonitorFacts({ records, alarms, pending, created, updated, last_alarm: alarm }, last) {
  return makeFacts([
    ["Records", formatCount(records)],
    ["Waiting", pending ? formatCount(pending) : null],
    ["Alarms", formatCount(alarms)],
    ["Last change", alarm && `since \u2068${alarm.since.name}\u2069`],
    ["Last record", last && el("bdi", {}, last.name)],
    ["Analysed", last && makeAge(updated)],
    ["Created", makeAge(created)],
  ]);
}

function makeSettingsPanel({ spec, priority, result }) {
  const { diagnosis, tolerance = {} } = spec;
  const link = diagnosis && el("a", { href: `#/jobs/${diagnosis}` }, `job ${diagnosis.slice(0, 8)}`);
  const interval = result?.interval_s ?? spec.interval;
  return el(
    "section",
    { class: "card" },
    el("h2", {}, "Settings"),
    makeFacts([
      ["Diagnosis", link],
      ["Simulation", formatSimulation(spec.simulation)],
      ["Input", spec.input],
      ["Output", spec.output],
      ["Channels", (spec.channels ?? []).join(", ")],
      ["Sampling time", spec.dt ? `${formatShort(spec.dt)} s` : null],
      ["False alarms", result?.false_alarms.given ?? spec.false_alarms],
      ["From record to record", interval ? formatDuration(interval) : null],
      ["Training", result || spec.training ? `${result?.training ?? spec.training} records` : null],
      ...Object.entries(tolerance).map(([name, value]) => [
        `Tolerance of ${name}`,
        `${formatShort(100 * value)} %`,
      ]),
      ["Priority", priority ? String(priority) : null],
    ]),
  );
}

async function deleteMonitor(path, monitor) {
  const text = `${getIsolatedMonitorName(monitor)} is deleted with its states. This cannot be undone.`;
  if (!(await askConfirmation("Delete this monitor?", text, "Delete it"))) return;
  await sendRequest(path, { method: "DELETE" });
  location.hash = "#/monitors";
}

/** Make the buttons; `getMonitor()` returns the monitor that is shown. */
function makeActions(path, getMonitor) {
  const handle = (act) =>
    runOnceAtATime(async () => {
      clearBanner("problem");
      await act().catch(showProblem);
    });
  const save = handle(() => download(`${path}/state`, `monitor-${getMonitor().id.slice(0, 8)}.json`));
  const remove = handle(() => deleteMonitor(path, getMonitor()));
  const saveButton = el("button", { type: "button", hidden: true, on: { click: save } }, "Save the state");
  return {
    node: el(
      "div",
      { class: "row actions" },
      saveButton,
      el("button", { type: "button", class: "danger", on: { click: remove } }, "Delete"),
    ),
    show({ result }) {
      saveButton.hidden = result === null;
    },
  };
}

/** Show a monitor in a host until the signal aborts. */
export function mountMonitor(host, { id }, signal) {
  const path = `v1/monitors/${encodeURIComponent(id)}`;
  const name = el("bdi", {}, "Monitor");
  const heading = el("h1", { tabindex: "-1" }, name);
  const status = makeStatusBadge();
  const factsHost = el("div");
  const settingsHost = el("div");
  const [alarms, states, records] = [makeAlarmsPanel(), makeStatesPanel(signal), makeRecordsPanel()];
  const history = makeRecordHistory(path, signal);
  let current = null;
  const actions = makeActions(path, () => current);

  function build() {
    host.replaceChildren(
      el("a", { class: "back", href: "#/monitors" }, "← Monitors"),
      el(
        "div",
        { class: "heading" },
        el("div", { class: "title" }, heading, status.node),
        el("code", { class: "soft small" }, id),
      ),
      actions.node,
      el("section", { class: "card status", "aria-label": "Status" }, factsHost),
      alarms.node,
      makeRecordUpload(path, wake),
      states.node,
      records.node,
      settingsHost,
    );
  }

  async function show(monitor) {
    await history.load(monitor);
    if (signal.aborted) return;
    if (current === null) build();
    else if (monitor.status !== current.status)
      announce(`${getIsolatedMonitorName(monitor)}: ${monitor.status}`);
    const isChanged = monitor.result !== null && monitor.updated !== current?.updated;
    current = monitor;
    document.title = `${getMonitorName(monitor)} · islands`;
    setText(name, getMonitorName(monitor));
    status.show(monitor);
    actions.show(monitor);
    factsHost.replaceChildren(makeMonitorFacts(monitor, history.analysed.at(-1)));
    if (isChanged) {
      alarms.show(monitor.result);
      states.show(monitor.result, history.analysed);
      records.show(monitor.result, history);
    }
    if (isChanged || !settingsHost.hasChildNodes()) settingsHost.replaceChildren(makeSettingsPanel(monitor));
  }

  function lost(problem) {
    document.title = "No such monitor · islands";
    host.replaceChildren(
      el("h1", { tabindex: "-1" }, "There is no such monitor"),
      el("p", {}, problem.message),
      el("p", {}, el("a", { href: "#/monitors" }, "Show all monitors")),
    );
  }

  const wake = followMonitor(path, { show, lost }, signal);
  host.replaceChildren(el("p", { class: "loading" }, "Loading…"));
  return {};
}
