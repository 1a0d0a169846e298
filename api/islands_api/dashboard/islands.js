/** Entry point: shows the page that the address selects, or the key form if the service needs a key. */

import "./components/banner.js";
import { listenForDroppedFiles } from "./components/file_upload.js";
import { connection, key } from "./lib/api.js";
import { el } from "./lib/dom.js";
import { mountCompare } from "./pages/compare.js";
import { mountData } from "./pages/data.js";
import { mountDataset } from "./pages/dataset.js";
import { mountJob } from "./pages/job.js";
import { mountJobs } from "./pages/jobs.js";
import { mountKeyForm } from "./pages/key.js";
import { mountMonitor } from "./pages/monitor.js";
import { mountMonitors } from "./pages/monitors.js";

const SCROLL_ITEM = "islands.place";

/** Page of each address. A page that has `update` is kept if only its details change. */
const ROUTES = [
  {
    pattern: /^\/jobs\/([^/]+)(?:\/models\/(\d+))?$/,
    view: ([, id]) => `job ${id}`,
    mount: (host, [, id, rank], query, signal) => mountJob(host, { id, rank: Number(rank) || null }, signal),
    details: ([, id, rank]) => ({ id, rank: Number(rank) || null }),
  },
  {
    pattern: /^\/jobs$/,
    view: () => "jobs",
    mount: (host, _match, query, signal) => mountJobs(host, Object.fromEntries(query), signal),
    details: (_match, query) => Object.fromEntries(query),
  },
  {
    pattern: /^\/data\/([^/]+)$/,
    view: ([, id], query) => `data set ${id} ${query}`,
    mount: (host, [, id], query, signal) =>
      mountDataset(host, { ...Object.fromEntries(query), id }, signal),
  },
  {
    pattern: /^\/compare$/,
    view: (_match, query) => `job comparison ${query}`,
    mount: (host, _match, query, signal) => mountCompare(host, Object.fromEntries(query), signal),
  },
  {
    pattern: /^\/data$/,
    view: (_match, query) => `data ${query}`,
    mount: (host, _match, query, signal) => mountData(host, Object.fromEntries(query), signal),
  },
  {
    pattern: /^\/monitors\/([^/]+)$/,
    view: ([, id]) => `monitor ${id}`,
    mount: (host, [, id], query, signal) => mountMonitor(host, { id }, signal),
  },
  {
    pattern: /^\/monitors$/,
    view: (_match, query) => `monitors ${query}`,
    mount: (host, _match, query, signal) => mountMonitors(host, Object.fromEntries(query), signal),
  },
];

const main = document.getElementById("main");
let current = { view: null, controller: new AbortController() };

function matchRoute() {
  const [path, text = ""] = location.hash.slice(1).split("?");
  const query = new URLSearchParams(text);
  for (const entry of ROUTES) {
    const match = entry.pattern.exec(path);
    if (match) return { ...entry, match, query, view: entry.view(match, query) };
  }
  return null;
}

function show() {
  if (current.view === "key") return;
  const target = matchRoute();
  if (target === null) {
    location.replace("#/jobs");
    return;
  }
  if (target.view === current.view && current.update) {
    current.update(target.details(target.match, target.query));
    return;
  }
  const first = current.view === null;
  current.controller.abort();
  const controller = new AbortController();
  const page = target.mount(main, target.match, target.query, controller.signal);
  current = { view: target.view, controller, ...page };
  renderTools();
  markSection();
  if (first) return;
  scrollTo(0, 0);
  main.querySelector("h1")?.focus({ preventScroll: true });
}

function showKeyForm({ detail }) {
  if (current.view === "key") return;
  current.controller.abort();
  key.forget();
  current = { view: "key", controller: new AbortController() };
  renderTools();
  markSection();
  document.title = "Key · islands";
  mountKeyForm(main, detail, () => {
    current = { view: null, controller: new AbortController() };
    show();
  });
}

/** Mark the section of the page that is shown. */
function markSection() {
  for (const link of document.querySelectorAll(".sections a")) {
    if (current.view?.startsWith(link.dataset.section)) link.setAttribute("aria-current", "true");
    else link.removeAttribute("aria-current");
  }
}

function renderTools() {
  const forgetKey = () => {
    key.forget();
    current = { ...current, view: "signed-out" };
    show();
  };
  const button = el("button", { type: "button", class: "quiet", on: { click: forgetKey } }, "Forget the key");
  document.getElementById("tools").replaceChildren(...(key.get() && current.view !== "key" ? [button] : []));
}

/** Restore the scroll position after a reload, as soon as the page is long enough. */
function restoreScroll() {
  history.scrollRestoration = "manual";
  const { hash, top } = JSON.parse(sessionStorage.getItem(SCROLL_ITEM) ?? "{}");
  addEventListener("pagehide", () =>
    sessionStorage.setItem(SCROLL_ITEM, JSON.stringify({ hash: location.hash, top: scrollY })));
  if (hash !== location.hash || !top) return;
  const observer = new ResizeObserver(() => {
    if (document.documentElement.scrollHeight < top + innerHeight) return;
    scrollTo(0, top);
    stop();
  });
  const stop = () => observer.disconnect();
  observer.observe(document.body);
  // Stop as soon as the user scrolls or types.
  for (const kind of ["wheel", "keydown", "pointerdown"]) addEventListener(kind, stop, { once: true });
  setTimeout(stop, 5000);
}

connection.addEventListener("unauthorised", showKeyForm);
addEventListener("hashchange", show);
listenForDroppedFiles();
restoreScroll();
show();
