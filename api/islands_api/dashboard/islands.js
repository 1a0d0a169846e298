/** Where the page begins: which view an address shows, and what happens when the service wants a key. */

import { connection, key } from "./api.js";
import "./banner.js";
import { el } from "./dom.js";
import { mountJob } from "./job.js";
import { mountJobs } from "./jobs.js";
import { askForKey } from "./key.js";

const PLACE = "islands.place";

/** What each address shows. A view that has `update` stays when only its details change. */
const ROUTES = [
  {
    pattern: /^\/jobs\/([^/]+)(?:\/models\/(\d+))?$/,
    view: ([, id]) => `job ${id}`,
    mount: (host, [, id, rank], query, signal) => mountJob(host, { id, rank: Number(rank) || null }, signal),
    details: ([, id, rank]) => ({ id, rank: Number(rank) || null }),
  },
  {
    pattern: /^\/jobs$/,
    view: (_match, query) => `jobs ${query}`,
    mount: (host, _match, query, signal) => mountJobs(host, Object.fromEntries(query), signal),
  },
];

const main = document.getElementById("main");
let shown = { view: null, end: new AbortController() };

function route() {
  const [path, text = ""] = location.hash.slice(1).split("?");
  const query = new URLSearchParams(text);
  for (const entry of ROUTES) {
    const match = entry.pattern.exec(path);
    if (match) return { ...entry, match, query, view: entry.view(match, query) };
  }
  return null;
}

function show() {
  if (shown.view === "key") return;
  const wanted = route();
  if (wanted === null) {
    location.replace("#/jobs");
    return;
  }
  if (wanted.view === shown.view && shown.update) {
    shown.update(wanted.details(wanted.match));
    return;
  }
  const first = shown.view === null;
  shown.end.abort();
  const end = new AbortController();
  shown = { view: wanted.view, end, ...wanted.mount(main, wanted.match, wanted.query, end.signal) };
  tools();
  if (first) return;
  scrollTo(0, 0);
  main.querySelector("h1")?.focus({ preventScroll: true });
}

function lock({ detail }) {
  if (shown.view === "key") return;
  shown.end.abort();
  key.forget();
  shown = { view: "key", end: new AbortController() };
  tools();
  document.title = "Key · islands";
  askForKey(main, detail, () => {
    shown = { view: null, end: new AbortController() };
    show();
  });
}

function tools() {
  const leave = () => {
    key.forget();
    shown = { ...shown, view: "left" };
    show();
  };
  const forget = el("button", { type: "button", class: "quiet", on: { click: leave } }, "Forget the key");
  document.getElementById("tools").replaceChildren(...(key.get() && shown.view !== "key" ? [forget] : []));
}

/** After a reload, go on where the reader was, as soon as the page is long enough again. */
function returnToPlace() {
  history.scrollRestoration = "manual";
  const { hash, top } = JSON.parse(sessionStorage.getItem(PLACE) ?? "{}");
  addEventListener("pagehide", () =>
    sessionStorage.setItem(PLACE, JSON.stringify({ hash: location.hash, top: scrollY })));
  if (hash !== location.hash || !top) return;
  const observer = new ResizeObserver(() => {
    if (document.documentElement.scrollHeight < top + innerHeight) return;
    scrollTo(0, top);
    stop();
  });
  const stop = () => observer.disconnect();
  observer.observe(document.body);
  // Whoever moves is not moved.
  for (const kind of ["wheel", "keydown", "pointerdown"]) addEventListener(kind, stop, { once: true });
  setTimeout(stop, 5000);
}

connection.addEventListener("locked", lock);
addEventListener("hashchange", show);
returnToPlace();
show();
