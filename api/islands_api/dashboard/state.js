/** A job's state in words and colour, and how far it is: the same in the list and on a job's own page. */

import { diagnoses, verdict } from "./diagnosis.js";
import { el, say } from "./dom.js";
import { count } from "./numbers.js";

export const STATES = ["queued", "running", "succeeded", "failed", "cancelled"];

/** Whether nothing happens to a job any more, unless somebody resumes it. */
export const ended = (job) => ["succeeded", "failed", "cancelled"].includes(job.state);

/** The word for how a job stands. */
export const standing = (job) => (job.cancel_requested && !ended(job) ? "cancelling" : job.state);

/** What a job is called. */
export const nameOf = (job) => job.name || `Job ${job.id.slice(0, 8)}`;

/** Make a badge; `show(job)` keeps it up to date. */
export function badge() {
  const node = el("span", { class: "state" });
  return {
    node,
    show(job) {
      node.className = `state ${standing(job)}`;
      say(node, standing(job));
    },
  };
}

function told(job) {
  if (diagnoses(job) && job.summary) return verdict(job.summary);
  const { phase, note, generation, generations } = job.progress ?? {};
  if (job.state === "queued" && generation === undefined) return "waits for its turn";
  if (generation === undefined) return note ?? phase ?? "";
  const at = `${count(generation)} / ${count(generations)}`;
  return job.state === "queued" ? `waits to go on at ${at}` : at;
}

/** Make a bar with what it means in words. A search that ended early, for it was good enough, is whole. */
export function progressBar() {
  const bar = el("progress", { max: "1", value: "0", "aria-label": "Progress" });
  const words = el("span", { class: "words" });
  return {
    node: el("div", { class: "progress" }, bar, words),
    show(job) {
      const { generation = 0, generations = 1 } = job.progress ?? {};
      bar.value = job.state === "succeeded" ? 1 : generation / Math.max(1, generations);
      // How long a diagnosis goes on nobody knows.
      if (diagnoses(job) && job.state === "running") bar.removeAttribute("value");
      bar.className = standing(job);
      words.classList.toggle("long", diagnoses(job));
      say(words, told(job));
    },
  };
}
