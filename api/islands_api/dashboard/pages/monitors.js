/** Page with the list of monitors: newest first, in pages, updated continuously. */

import {
  getIsolatedMonitorName,
  getMonitorName,
  makeStatusBadge,
} from "../components/monitoring/monitor_status.js";
import { makePagedTable } from "../components/paged_table.js";
import { getJson } from "../lib/api.js";
import { makeAge } from "../lib/clock.js";
import { announce, el, setText } from "../lib/dom.js";
import { NONE, formatCount } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";

/** Number of monitors on a page. */
const PAGE_SIZE = 25;

/** Seconds between two polls while records are analysed, and otherwise. */
const [ACTIVE_POLL_SECONDS, IDLE_POLL_SECONDS] = [2, 4];

const makeAddress = (cursor) => (cursor ? `#/monitors?${new URLSearchParams({ cursor })}` : "#/monitors");

/** Make the row of a monitor; `show(monitor)` updates it and announces a change of its status. */
function makeRow(monitor) {
  const status = makeStatusBadge();
  const name = el("bdi");
  const [records, alarms, last] = ["records", "alarms", "last record"].map((label) =>
    el("td", { class: "figure", "data-label": label }));
  const change = el("td", { class: "change" });
  let lastStatus = null;
  const node = el(
    "tr",
    { "data-monitor": monitor.id },
    el("td", {}, status.node),
    el(
      "th",
      { scope: "row" },
      el("a", { href: `#/monitors/${monitor.id}` }, name),
      monitor.name && el("code", { class: "soft small" }, monitor.id.slice(0, 8)),
    ),
    records,
    alarms,
    change,
    last,
    el("td", { class: "figure", "data-label": "created" }, makeAge(monitor.created)),
  );

  function show(newMonitor) {
    status.show(newMonitor);
    setText(name, getMonitorName(newMonitor));
    const waiting = newMonitor.pending ? ` + ${formatCount(newMonitor.pending)} waiting` : "";
    setText(records, formatCount(newMonitor.records) + waiting);
    setText(alarms, formatCount(newMonitor.alarms));
    setText(change, newMonitor.last_alarm?.words ?? "");
    last.replaceChildren(newMonitor.records ? makeAge(newMonitor.updated) : NONE);
    if (lastStatus !== null && lastStatus !== newMonitor.status)
      announce(`${getIsolatedMonitorName(newMonitor)}: ${newMonitor.status}`);
    lastStatus = newMonitor.status;
  }

  show(monitor);
  return { node, show };
}

function makeEmptyMessage(cursor) {
  if (cursor)
    return el("p", { class: "empty" }, "No older monitors. ", el("a", { href: "#/monitors" }, "Show all"));
  return el(
    "section",
    { class: "welcome card" },
    el("h2", {}, "No monitors yet"),
    el(
      "p",
      {},
      "A monitor follows a diagnosed simulation from record to record, and raises an alarm when an effect ",
      "has changed. Create one on the page of a ",
      el("a", { href: "#/jobs?kind=discrepancy&state=succeeded" }, "diagnosis that has succeeded"),
      " (“Monitor later records with this diagnosis”), or with the command ",
      el("code", {}, "islands monitors add"),
      ".",
    ),
  );
}

/** Show the list in a host until the signal aborts. */
export function mountMonitors(host, { cursor = "" }, signal) {
  document.title = "Monitors · islands";
  const table = makePagedTable({
    caption: "Monitors, newest first",
    headings: [
      ...["Status", "Monitor"],
      ...["Records", "Alarms"].map((name) => [name, "figure"]),
      "Last change",
      ...["Last record", "Created"].map((name) => [name, "figure"]),
    ],
    makeRow,
    makeEmptyMessage: () => makeEmptyMessage(cursor),
    makeAddress,
    cursor,
  });
  host.replaceChildren(
    el("div", { class: "heading" }, el("h1", { tabindex: "-1" }, "Monitors")),
    ...table.nodes,
  );
  poll(async () => {
    const query = new URLSearchParams({ limit: PAGE_SIZE, ...(cursor && { cursor }) });
    const page = await getJson(`v1/monitors?${query}`, { signal });
    if (!signal.aborted) table.show(page);
    return page.items.some(({ pending }) => pending) ? ACTIVE_POLL_SECONDS : IDLE_POLL_SECONDS;
  }, signal);
  return {};
}
