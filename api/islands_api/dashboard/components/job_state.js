/** State and progress of a job, for the list of jobs and the page of a job. */

import { el, setText } from "../lib/dom.js";
import { formatCount, formatDuration } from "../lib/numbers.js";
import { formatVerdict, isSearch } from "./job_words.js";

export const STATES = ["queued", "running", "succeeded", "failed", "cancelled"];

/** Return whether a job has ended; only a resumption can change it then. */
export const isEnded = (job) => ["succeeded", "failed", "cancelled"].includes(job.state);

/** Return the state of a job for display. */
export const getState = (job) => (job.cancel_requested && !isEnded(job) ? "cancelling" : job.state);

/** Return the name of a job, for an element `bdi`: some characters reverse the text that follows. */
export const getName = (job) => job.name || `Job ${job.id.slice(0, 8)}`;

/** Return the name of a job for a sentence, between characters that isolate its direction. */
export const getIsolatedName = (job) => `\u2068${getName(job)}\u2069`;

/** Return the class of the models of a search: the preset auto chooses it before the first generation. */
export const getModelClass = ({ spec, progress }) => progress?.model ?? spec.model ?? "narx";

/** Make a badge with the state; `show(job)` updates it. */
export function makeBadge() {
  const node = el("span", { class: "state" });
  return {
    node,
    show(job) {
      node.className = `state ${getState(job)}`;
      setText(node, getState(job));
    },
  };
}

/** Return whether a search runs a stage before or after its epochs, or waits for capacity before them. */
function isBetweenEpochs(job) {
  const { phase = "search" } = job.progress ?? {};
  return job.state === "running" && phase !== "search";
}

function formatQueue({ note, position, seconds_to_start: start, generation, generations }) {
  if (note) return note;
  const time = Number.isFinite(start) ? `, starts in about ${formatDuration(start)}` : "";
  const place = position ? `, number ${formatCount(position)}${time}` : "";
  if (generation === undefined) return `waiting${place}`;
  return `waiting to resume at ${formatCount(generation)} / ${formatCount(generations)}${place}`;
}

function formatProgress(job) {
  if (!isSearch(job) && job.summary) return formatVerdict(job.summary);
  const progress = job.progress ?? {};
  const { phase, note, generation, generations } = progress;
  if (isBetweenEpochs(job)) return note ?? phase;
  if (job.state === "queued") return formatQueue(progress);
  if (generation === undefined) return job.state === "running" ? (note ?? phase ?? "") : "";
  return `${formatCount(generation)} / ${formatCount(generations)}`;
}

/**
 * Make a progress bar with a text. It is full if a search succeeded, even before its last generation.
 * With `showsReason`, the text of a failed job is the reason. `show(job, isDescribed)` has no text between
 * epochs if the phase is described elsewhere.
 */
export function makeProgressBar({ showsReason = false } = {}) {
  const bar = el("progress", { max: "1", value: "0", "aria-label": "Progress" });
  const text = el("span", { class: "progress-text" });
  return {
    node: el("div", { class: "progress" }, bar, text),
    show(job, isDescribed = false) {
      const { fraction, generation = 0, generations = 1 } = job.progress ?? {};
      const reached = Number.isFinite(fraction) ? fraction : generation / Math.max(1, generations);
      bar.value = job.state === "succeeded" ? 1 : reached;
      // Before the first report.
      if (job.state === "running" && reached === 0) bar.removeAttribute("value");
      bar.className = getState(job);
      const reason = showsReason && job.state === "failed" ? job.problem?.detail : null;
      text.classList.toggle("reason", Boolean(reason));
      text.title = reason ?? "";
      const { note, seconds_to_start: start } = job.progress ?? {};
      const isSentence = Boolean(reason) || (job.state === "queued" && Boolean(note || start));
      text.classList.toggle("long", isSentence || !isSearch(job) || isBetweenEpochs(job));
      const isTold = isDescribed && isBetweenEpochs(job);
      setText(text, reason ?? (isTold ? "" : formatProgress(job)));
    },
  };
}
