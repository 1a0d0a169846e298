/** Ages of events by the clock of the service, which may differ from the clock of this machine. */

import { el, setText } from "./dom.js";

/** Milliseconds that the clock of the service is ahead of the local clock. */
let offset = 0;

/** Set the clock offset from the header Date of a response. */
export function synchronise(response) {
  const serverTime = Date.parse(response.headers.get("date") ?? "");
  if (Number.isFinite(serverTime)) offset = serverTime - Date.now();
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

setInterval(() => {
  for (const node of document.querySelectorAll("time[data-age]"))
    setText(node, formatAge(Date.parse(node.dateTime)));
}, 5000);
