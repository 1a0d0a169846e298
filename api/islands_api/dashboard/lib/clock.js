/** Ages by the clock of the service, which may differ from that of this machine, times left, and rates. */

import { el, setText } from "./dom.js";
import { formatDuration } from "./numbers.js";

/** Milliseconds that the clock of the service is ahead of the local clock. */
let offset = 0;

/** Set the clock offset from the header Date of a response. */
export function synchronise(response) {
  const serverTime = Date.parse(response.headers.get("date") ?? "");
  if (Number.isFinite(serverTime)) offset = serverTime - Date.now();
}

/** Seconds between two changes of a text: a reader could not follow more. */
const READING_SECONDS = 0.25;

/** Make a function that runs an action at once, or for all calls in a period together at its end. */
export function limitRate(action, signal) {
  let [last, timer] = [-Infinity, 0];
  const run = () => {
    clearTimeout(timer);
    [last, timer] = [performance.now(), 0];
    if (!signal.aborted) action();
  };
  return () => {
    const wait = last + 1000 * READING_SECONDS - performance.now();
    if (wait <= 0) run();
    else timer ||= setTimeout(run, wait);
  };
}

const UNITS = [
  [86400, "d"],
  [3600, "h"],
  [60, "min"],
];

function formatAge(moment) {
  const seconds = (Date.now() + offset - moment) / 1000;
  // The header Date has a resolution of one second.
  if (seconds < 5) return "just now";
  const [size, unit] = UNITS.find(([least]) => seconds >= least) ?? [1, "s"];
  return `${Math.floor(seconds / size)} ${unit} ago`;
}

/** Format a time in UTC. */
export const formatUtc = (text) => `${new Date(text).toISOString().slice(0, 19).replace("T", " ")} UTC`;

/** Make an element with the age of a time, kept up to date, and the time itself as its title. */
export const makeAge = (text) => {
  const attributes = { datetime: text, title: text && formatUtc(text), "data-age": true };
  return text && el("time", attributes, formatAge(Date.parse(text)));
};

/** Part of the time left after which an estimate without a further report is not shown. */
const VALID_PART = 0.75;

const LATE = "longer than expected";

function formatLeft({ left, since }) {
  const passed = (performance.now() - Number(since)) / 1000;
  return passed > VALID_PART * Number(left) ? LATE : `about ${formatDuration(Number(left) - passed)}`;
}

/** Make an element with the time left, which decreases until the next report replaces it. */
export function makeCountdown(seconds) {
  const node = el("span", { "data-left": seconds, "data-since": performance.now() });
  setText(node, formatLeft(node.dataset));
  return node;
}

setInterval(() => {
  for (const node of document.querySelectorAll("[data-left]")) setText(node, formatLeft(node.dataset));
}, 1000);

setInterval(() => {
  for (const node of document.querySelectorAll("time[data-age]"))
    setText(node, formatAge(Date.parse(node.dateTime)));
}, 5000);
