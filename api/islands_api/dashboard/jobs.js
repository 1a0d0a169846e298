/**
 * The list of jobs: newest first, by state, page by page, kept up to date.
 * To submit from the page belongs beside this: a module `submit.js`, its route in islands.js, a link here.
 */

import { json } from "./api.js";
import { age } from "./clock.js";
import { announce, el, say } from "./dom.js";
import { NONE, number } from "./numbers.js";
import { STATES, badge, ended, nameOf, progressBar, standing } from "./state.js";
import { repeat } from "./watch.js";

/** Jobs of a page, and seconds between two looks: while one of them goes on, and otherwise. */
const PAGE = 25;
const [BUSY, QUIET] = [2, 4];

const address = (state, cursor) => {
  const query = new URLSearchParams(Object.entries({ state, cursor }).filter(([, value]) => value));
  return query.size ? `#/jobs?${query}` : "#/jobs";
};

function filters(state) {
  const link = (name, value) =>
    el("a", { href: address(value), "aria-current": value === state ? "page" : null }, name);
  const links = [link("all", ""), ...STATES.map((each) => link(each, each))];
  return el("nav", { class: "filters", "aria-label": "Jobs by state" }, links);
}

/** Make a job's row; `show(job)` keeps it up to date, and says aloud when its state has changed. */
function row(job) {
  const state = badge();
  const bar = progressBar();
  const best = el("td", { class: "figure", "data-label": "best" });
  const attempt = el("td", { class: "figure", "data-label": "attempt" });
  const link = el("a", { href: `#/jobs/${job.id}` });
  let before = null;
  const node = el(
    "tr",
    { "data-job": job.id },
    el("td", {}, state.node),
    el("th", { scope: "row" }, link, job.name && el("code", { class: "soft small" }, job.id.slice(0, 8))),
    el("td", { class: "wide" }, bar.node),
    best,
    el("td", { class: "figure" }, age(job.created)),
    attempt,
  );
  function show(now) {
    state.show(now);
    bar.show(now);
    say(link, nameOf(now));
    say(best, number(now.progress?.best_error));
    say(attempt, now.attempt ? String(now.attempt) : NONE);
    if (before !== null && before !== standing(now)) announce(`${nameOf(now)}: ${standing(now)}`);
    before = standing(now);
  }
  show(job);
  return { node, show };
}

/** Have the table's body hold these jobs. Rows that stay are not moved: one may have the focus. */
function arrange(body, rows, jobs) {
  const wanted = new Set(jobs.map((job) => job.id));
  for (const [id, { node }] of rows) {
    if (!wanted.has(id)) {
      node.remove();
      rows.delete(id);
    }
  }
  jobs.forEach((job, at) => {
    if (rows.has(job.id)) rows.get(job.id).show(job);
    else rows.set(job.id, row(job));
    const { node } = rows.get(job.id);
    if (body.children[at] !== node) body.insertBefore(node, body.children[at] ?? null);
  });
}

const command = (title, text) =>
  el("div", {}, el("h3", {}, title), el("pre", { tabindex: "0" }, el("code", {}, text)));

/** Tell a newcomer how the first job is submitted, by the address that this page came from. */
function welcome() {
  const url = location.href.replace(/[?#].*$/, "").replace(/\/$/, "");
  const curl = [
    `curl -F file=@piezo.csv ${url}/v1/datasets`,
    `curl ${url}/v1/jobs -H 'Content-Type: application/json' \\`,
    `  -d '{"dataset": "THE ID IN THE ANSWER", "inputs": ["u_V"], "output": "y_um"}'`,
  ];
  const python = [
    "from islands_api import Client",
    "",
    `client = Client("${url}")`,
    'job = client.submit(client.upload("piezo.csv"), inputs=["u_V"], output="y_um")',
    'print(client.wait(job).summary["equation"])',
  ];
  const line = [`islands jobs submit piezo.csv --input u_V --output y_um --watch \\`, `  --url ${url}`];
  return el(
    "section",
    { class: "welcome card" },
    el("h2", {}, "No jobs yet"),
    el(
      "p",
      {},
      "Submit a record of an input and an output, a CSV with a header or NPZ, MAT, Parquet; the search for ",
      "its equation shows up here at once. Three ways, the columns called ",
      el("code", {}, "u_V"),
      " and ",
      el("code", {}, "y_um"),
      ":",
    ),
    command("Command line", line.join("\n")),
    command("Python", python.join("\n")),
    command("curl", curl.join("\n")),
    el(
      "p",
      { class: "soft small" },
      "Where the service asks for a key, give it by ",
      el("code", {}, "--key"),
      ", ",
      el("code", {}, "Client(url, key)"),
      " or ",
      el("code", {}, "-H 'Authorization: Bearer …'"),
      ".",
    ),
  );
}

function nothing(state, cursor) {
  if (!state && !cursor) return welcome();
  const text = cursor ? "No older jobs." : `No job is ${state}.`;
  return el("p", { class: "nothing" }, text, " ", el("a", { href: "#/jobs" }, "Show all jobs"));
}

/** Show the list in a host until the signal aborts. */
export function mountJobs(host, { state = "", cursor = "" }, signal) {
  document.title = "Jobs · islands";
  const headings = ["State", "Job", "Progress", "Best error", "Submitted", "Attempt"];
  const body = el("tbody");
  const table = el(
    "table",
    { class: "jobs" },
    el("caption", { class: "unseen" }, "Jobs, newest first"),
    el("thead", {}, el("tr", {}, headings.map((name, at) =>
      el("th", { scope: "col", class: at > 2 ? "figure" : null }, name)))),
    body,
  );
  const list = el("div", {}, el("p", { class: "waiting" }, "Asking the service…"));
  const pages = el("nav", { class: "pages", "aria-label": "Pages" });
  const rows = new Map();
  let empty = null;

  function show({ items, next }) {
    arrange(body, rows, items);
    if (empty !== (items.length === 0)) {
      empty = items.length === 0;
      list.replaceChildren(empty ? nothing(state, cursor) : table);
    }
    const links = [cursor && ["← Newest", address(state)], next && ["Older →", address(state, next)]];
    const wanted = links.filter(Boolean);
    if (wanted.map(String).join() !== [...pages.children].map((a) => [a.textContent, a.hash]).join())
      pages.replaceChildren(...wanted.map(([name, href]) => el("a", { class: "button", href }, name)));
  }

  host.replaceChildren(
    el("div", { class: "heading" }, el("h1", { tabindex: "-1" }, "Jobs"), filters(state)),
    list,
    pages,
  );
  repeat(async () => {
    const query = new URLSearchParams({ limit: PAGE, ...(state && { state }), ...(cursor && { cursor }) });
    const page = await json(`v1/jobs?${query}`, { signal });
    if (!signal.aborted) show(page);
    return page.items.every(ended) ? QUIET : BUSY;
  }, signal);
  return {};
}
