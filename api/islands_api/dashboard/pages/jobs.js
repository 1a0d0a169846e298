/** Page with the list of jobs: newest first, filtered by state, in pages, updated continuously. */

import { makeFileButton } from "../components/file_upload.js";
import {
  STATES,
  getIsolatedName,
  getName,
  getState,
  isEnded,
  makeBadge,
  makeProgressBar,
} from "../components/job_state.js";
import { makePagedTable } from "../components/paged_table.js";
import { getJson } from "../lib/api.js";
import { makeAge } from "../lib/clock.js";
import { announce, el, setText } from "../lib/dom.js";
import { NONE, formatNumber } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";

/** Number of jobs on a page. */
const PAGE_SIZE = 25;

/** Seconds between two polls while a job on the page has not ended. */
const ACTIVE_POLL_SECONDS = 2;

/** Seconds between two polls if all jobs on the page have ended. */
const IDLE_POLL_SECONDS = 4;

const makeAddress = (state, cursor) => {
  const query = new URLSearchParams(Object.entries({ state, cursor }).filter(([, value]) => value));
  return query.size ? `#/jobs?${query}` : "#/jobs";
};

function makeFilters(state) {
  const link = (name, value) =>
    el("a", { href: makeAddress(value), "aria-current": value === state ? "page" : null }, name);
  const links = [link("all", ""), ...STATES.map((each) => link(each, each))];
  return el("nav", { class: "filters", "aria-label": "Jobs by state" }, links);
}

/** Make the row of a job; `show(job)` updates it and announces a change of state to screen readers. */
function makeRow(job) {
  const state = makeBadge();
  const bar = makeProgressBar({ showsReason: true });
  const best = el("td", { class: "figure", "data-label": "best" });
  const attempt = el("td", { class: "figure", "data-label": "attempt" });
  const name = el("bdi");
  const link = el("a", { href: `#/jobs/${job.id}` }, name);
  let lastState = null;
  const node = el(
    "tr",
    { "data-job": job.id },
    el("td", {}, state.node),
    el("th", { scope: "row" }, link, job.name && el("code", { class: "soft small" }, job.id.slice(0, 8))),
    el("td", { class: "wide" }, bar.node),
    best,
    el("td", { class: "figure" }, makeAge(job.created)),
    attempt,
  );
  function show(newJob) {
    state.show(newJob);
    bar.show(newJob);
    setText(name, getName(newJob));
    setText(best, formatNumber(newJob.progress?.best_error));
    setText(attempt, newJob.attempt ? String(newJob.attempt) : NONE);
    const newState = getState(newJob);
    if (lastState !== null && lastState !== newState) announce(`${getIsolatedName(newJob)}: ${newState}`);
    lastState = newState;
  }
  show(job);
  return { node, show };
}

const makeCommandBlock = (title, text) =>
  el("div", {}, el("h3", {}, title), el("pre", { tabindex: "0" }, el("code", {}, text)));

/** Make the instructions for the first job, with the URL of this page. */
function makeWelcomeCard() {
  const url = location.href.replace(/[?#].*$/, "").replace(/\/$/, "");
  const curl = [
    `curl -F file=@piezo.csv ${url}/v1/datasets`,
    `curl ${url}/v1/jobs -H 'Content-Type: application/json' \\`,
    `  -d '{"dataset": "THE ID IN THE RESPONSE", "inputs": ["u_V"], "output": "y_um"}'`,
  ];
  const python = [
    "from islands_api import Client",
    "",
    `client = Client("${url}")`,
    'job = client.submit(client.upload("piezo.csv"), inputs=["u_V"], output="y_um")',
    'print(client.wait(job).summary["equation"])',
  ];
  const cli = [`islands jobs submit piezo.csv --input u_V --output y_um --watch \\`, `  --url ${url}`];
  return el(
    "section",
    { class: "welcome card" },
    el("h2", {}, "No jobs yet"),
    el(
      "p",
      {},
      "Drop a record with an input and an output on this page (CSV and other text, Excel, MATLAB, HDF5, ",
      "Parquet, NPZ, MDF or TDMS), look at it, and start.",
    ),
    makeFileButton(),
    el(
      "p",
      {},
      "Or submit it from a program; the columns are called ",
      el("code", {}, "u_V"),
      " and ",
      el("code", {}, "y_um"),
      ":",
    ),
    makeCommandBlock("Command line", cli.join("\n")),
    makeCommandBlock("Python", python.join("\n")),
    makeCommandBlock("curl", curl.join("\n")),
    el(
      "p",
      { class: "soft small" },
      "If the service needs a key, pass it with ",
      el("code", {}, "--key"),
      ", ",
      el("code", {}, "Client(url, key)"),
      " or ",
      el("code", {}, "-H 'Authorization: Bearer …'"),
      ".",
    ),
  );
}

function makeEmptyMessage(state, cursor) {
  if (!state && !cursor) return makeWelcomeCard();
  const text = cursor ? "No older jobs." : `No job is ${state}.`;
  return el("p", { class: "empty" }, text, " ", el("a", { href: "#/jobs" }, "Show all jobs"));
}

/** Show the list in a host until the signal aborts. */
export function mountJobs(host, { state = "", cursor = "" }, signal) {
  document.title = "Jobs · islands";
  const table = makePagedTable({
    caption: "Jobs, newest first",
    headings: [
      ...["State", "Job", "Progress"],
      ...["Best error", "Submitted", "Attempt"].map((name) => [name, "figure"]),
    ],
    makeRow,
    makeEmptyMessage: () => makeEmptyMessage(state, cursor),
    makeAddress: (next) => makeAddress(state, next),
    cursor,
  });
  host.replaceChildren(
    el("div", { class: "heading" }, el("h1", { tabindex: "-1" }, "Jobs"), makeFilters(state)),
    ...table.nodes,
  );
  poll(async () => {
    const filter = { ...(state && { state }), ...(cursor && { cursor }) };
    const query = new URLSearchParams({ limit: PAGE_SIZE, ...filter });
    const page = await getJson(`v1/jobs?${query}`, { signal });
    if (!signal.aborted) table.show(page);
    return page.items.every(isEnded) ? IDLE_POLL_SECONDS : ACTIVE_POLL_SECONDS;
  }, signal);
  return {};
}
