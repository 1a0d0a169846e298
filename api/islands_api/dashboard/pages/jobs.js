/** Page with the list of jobs: newest first, filtered and searched, in pages, updated continuously. */

import { makeFileButton } from "../components/file_upload.js";
import { ALL, makeJobFilters, makeJobsAddress } from "../components/job_filters.js";
import { followRows, makeJobRow } from "../components/job_row.js";
import { makeJobSelection } from "../components/job_selection.js";
import { isEnded } from "../components/job_state.js";
import { makePagedTable } from "../components/paged_table.js";
import { getJson } from "../lib/api.js";
import { el } from "../lib/dom.js";
import { poll } from "../lib/polling.js";

/** Number of jobs on a page. */
const PAGE_SIZE = 25;

/** Seconds between two polls while a job on the page has not ended. */
const ACTIVE_POLL_SECONDS = 2;

/** Seconds between two polls if all jobs on the page have ended. */
const IDLE_POLL_SECONDS = 4;

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
      "Parquet, NPZ, MDF or TDMS), look at its signals, and start the search for its equation.",
    ),
    makeFileButton(),
    el(
      "p",
      {},
      "Without a record, ",
      el("code", {}, "islands examples ."),
      " writes four. From a program, for the columns ",
      el("code", {}, "u_V"),
      " and ",
      el("code", {}, "y_um"),
      " of ",
      el("code", {}, "piezo.csv"),
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

function makeEmptyMessage(filters) {
  const { state, cursor, kind, tag, q, sort, owner } = filters;
  if (!Object.values(filters).some(Boolean)) return makeWelcomeCard();
  const isOnlyState = state && !owner && !kind && !tag && !q && !sort;
  let text = isOnlyState ? `No job is ${state}.` : "No job matches these filters.";
  if (cursor) text = "No further jobs.";
  return el("p", { class: "empty" }, text, " ", el("a", { href: "#/jobs" }, "Show all jobs"));
}

/** Return the path of the list with some filters; that of all owners is for administrators. */
function getListPath({ owner, ...filters }) {
  const given = owner && owner !== ALL ? { ...filters, owner } : filters;
  const entries = Object.entries(given).filter(([, value]) => value);
  return `v1/${owner ? "admin/" : ""}jobs?${new URLSearchParams([["limit", PAGE_SIZE], ...entries])}`;
}

/** Return whether the rows must not move: the pointer is over them, a name is edited, a job is selected. */
function isInUse(table, selection) {
  const isPointed = matchMedia("(hover: hover)").matches && table.querySelector("tbody:hover") !== null;
  return isPointed || table.querySelector("form") !== null || !selection.isEmpty();
}

/** Make the heading of a column by which the list can be sorted. */
function makeSortHeading(name, sort, order, filters) {
  const href = makeJobsAddress({ ...filters, sort, cursor: "" });
  const isChosen = (filters.sort ?? "") === sort;
  const arrow = order === "ascending" ? " ↑" : " ↓";
  return [el("a", { href }, name, isChosen && arrow), "figure", isChosen ? order : null];
}

/** Show the list in a host until the signal aborts; `update(filters)` shows another part of it. */
export function mountJobs(host, firstFilters, signal) {
  document.title = "Jobs · islands";
  const heading = el("h1", { tabindex: "-1" }, "Jobs");
  const [bars, list] = [makeJobFilters(signal), el("div")];
  let [filters, table, selection, self] = [null, null, null, undefined];

  function refresh() {
    table.release();
    wake();
  }

  function showFilters({ state, kind, tag, q, sort, cursor, owner }) {
    filters = { state, kind, tag, q, sort, cursor, owner };
    bars.show(filters);
    selection = makeJobSelection({ refresh });
    table = makePagedTable({
      caption: filters.sort ? "Jobs with a model, least error first" : "Jobs, newest first",
      headings: [
        [selection.all, "choice"],
        ...["State", "Job", "Result"],
        owner ? ["Error", "figure"] : makeSortHeading("Error", "error", "ascending", filters),
        ["Size", "figure"],
        owner ? ["Submitted", "figure"] : makeSortHeading("Submitted", "", "descending", filters),
      ],
      makeRow: (job) => makeJobRow(job, selection, { showsOwner: Boolean(owner), self }),
      makeEmptyMessage: () => makeEmptyMessage(filters),
      makeAddress: (cursor) => makeJobsAddress({ ...filters, cursor }),
      cursor: filters.cursor,
      isHeld: (node) => isInUse(node, selection),
    });
    list.replaceChildren(selection.bar, ...table.nodes);
  }

  host.replaceChildren(el("div", { class: "heading" }, heading, ...bars.nodes), list);
  followRows(list);
  showFilters(firstFilters);
  const wake = poll(async () => {
    const asked = filters;
    if (asked.owner && self === undefined) self = (await getJson("v1/caller", { signal })).owner;
    const page = await getJson(getListPath(asked), { signal });
    // The user may have changed the filters meanwhile.
    if (asked !== filters) return 0;
    if (!signal.aborted) {
      table.show(page);
      selection.keep(new Set([...list.querySelectorAll("tr[data-job]")].map((row) => row.dataset.job)));
    }
    return page.items.every(isEnded) ? IDLE_POLL_SECONDS : ACTIVE_POLL_SECONDS;
  }, signal);
  return {
    update(newFilters) {
      const isOtherPage = newFilters.cursor !== filters.cursor;
      showFilters(newFilters);
      wake();
      if (!isOtherPage) return;
      scrollTo(0, 0);
      heading.focus({ preventScroll: true });
    },
  };
}
