/** Entry point: shows the page that the address selects, or the key form if the service needs a key. */

import { showProblem } from "./components/banner.js";
import { listenForDroppedFiles } from "./components/file_upload.js";
import { connection, key } from "./lib/api.js";
import { el } from "./lib/dom.js";
import { mountKeyForm } from "./pages/key.js";

const SCROLL_ITEM = "islands.place";

/**
 * Page of each address, whose module is loaded when it is first shown. A page that has `update` is kept if
 * only its details change.
 */
const ROUTES = [
  {
    pattern: /^\/jobs\/([^/]+)(?:\/models\/(\d+))?$/,
    view: ([, id]) => `job ${id}`,
    load: async () => (await import("./pages/job.js")).mountJob,
    details: ([, id, rank]) => ({ id, rank: Number(rank) || null }),
  },
  {
    pattern: /^\/jobs$/,
    view: () => "jobs",
    load: async () => (await import("./pages/jobs.js")).mountJobs,
    details: (_match, query) => Object.fromEntries(query),
  },
  {
    pattern: /^\/data\/([^/]+)$/,
    view: ([, id], query) => `data set ${id} ${query}`,
    load: async () => (await import("./pages/dataset.js")).mountDataset,
    details: ([, id], query) => ({ ...Object.fromEntries(query), id }),
  },
  {
    pattern: /^\/compare$/,
    view: (_match, query) => `job comparison ${query}`,
    load: async () => (await import("./pages/compare.js")).mountCompare,
    details: (_match, query) => Object.fromEntries(query),
  },
  {
    pattern: /^\/data$/,
    view: (_match, query) => `data ${query}`,
    load: async () => (await import("./pages/data.js")).mountData,
    details: (_match, query) => Object.fromEntries(query),
  },
  {
    pattern: /^\/monitors\/([^/]+)$/,
    view: ([, id]) => `monitor ${id}`,
    load: async () => (await import("./pages/monitor.js")).mountMonitor,
    details: ([, id]) => ({ id }),
  },
  {
    pattern: /^\/monitors$/,
    view: (_match, query) => `monitors ${query}`,
    load: async () => (await import("./pages/monitors.js")).mountMonitors,
    details: (_match, query) => Object.fromEntries(query),
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

async function show() {
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
  current = { view: target.view, controller };
  renderTools();
  markSection();
  let mount;
  try {
    mount = await target.load();
  } catch {
    showProblem(new Error("The page could not be loaded: check the connection, and reload."));
    return;
  }
  if (controller.signal.aborted) return;
  Object.assign(current, mount(main, target.details(target.match, target.query), controller.signal));
  if (first) return;
  scrollTo(0, 0);
  main.querySelector("h1")?.focus({ preventScroll: true });
}

function showKeyForm({ detail }) {
  if (current.view === "key") return;
  current.controller.abort();
  // Without a key that was entered, there is nothing to correct.
  const problem = key.get() ? detail : null;
  key.forget();
  current = { view: "key", controller: new AbortController() };
  renderTools();
  markSection();
  document.title = "Key · islands";
  mountKeyForm(main, problem, () => {
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
