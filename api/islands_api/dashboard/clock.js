/** The service's time: ages are told by its clock, whatever this machine's says. */

import { el, say } from "./dom.js";

let ahead = 0;

/** Learn the service's time from an answer. */
export function synchronise(answer) {
  const told = Date.parse(answer.headers.get("date") ?? "");
  if (Number.isFinite(told)) ahead = told - Date.now();
}

const UNITS = [
  [86400, "d"],
  [3600, "h"],
  [60, "min"],
];

function ago(moment) {
  const seconds = (Date.now() + ahead - moment) / 1000;
  // The answer's date has whole seconds only.
  if (seconds < 5) return "just now";
  const [size, unit] = UNITS.find(([least]) => seconds >= least) ?? [1, "s"];
  return `${Math.floor(seconds / size)} ${unit} ago`;
}

/** Write a moment in universal time. */
export const utc = (text) => `${new Date(text).toISOString().slice(0, 19).replace("T", " ")} UTC`;

/** Show how long ago something was; the moment itself on demand. It stays true while it is shown. */
export const age = (text) =>
  text && el("time", { datetime: text, title: utc(text), "data-age": true }, ago(Date.parse(text)));

setInterval(() => {
  for (const node of document.querySelectorAll("time[data-age]")) say(node, ago(Date.parse(node.dateTime)));
}, 5000);
