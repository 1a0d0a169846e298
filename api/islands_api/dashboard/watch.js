/** Keeps what is shown true: asks again and again, and follows a job's events. */

import { Away, Problem, ask, events, patience, pause } from "./api.js";
import { clear, complain } from "./banner.js";
import { ended } from "./state.js";

/** Seconds between two looks at a job that has ended: somebody else may resume it. */
const RESTING = 5;

/** Seconds until the next try after the service has said no. */
const REFUSED = 5;

function seen(signal) {
  return new Promise((resolve) => {
    const look = () => {
      if (document.hidden && !signal.aborted) return;
      document.removeEventListener("visibilitychange", look);
      signal.removeEventListener("abort", look);
      resolve();
    };
    document.addEventListener("visibilitychange", look);
    signal.addEventListener("abort", look);
    look();
  });
}

/**
 * Do something again and again until the signal aborts. `what` returns the seconds until the next time,
 * Infinity to end. Nothing is asked for while nobody looks. Return a function that has it done at once.
 */
export function repeat(what, signal) {
  const tries = patience();
  let hurry = new AbortController();
  async function once() {
    try {
      const seconds = await what();
      tries.reset();
      clear("poll");
      return seconds;
    } catch (error) {
      if (signal.aborted || error.status === 401) return Infinity;
      if (error instanceof Away) return tries.next();
      complain(error, "poll");
      if (error instanceof Problem) return Math.max(REFUSED, error.wait);
      throw error;
    }
  }
  async function run() {
    for (;;) {
      const seconds = await once();
      if (seconds === Infinity) return;
      await pause(seconds, AbortSignal.any([signal, hurry.signal]));
      hurry = new AbortController();
      await seen(signal);
      if (signal.aborted) return;
    }
  }
  run();
  signal.addEventListener("abort", () => clear("poll"), { once: true });
  return () => hurry.abort();
}

/**
 * Follow a job: `show(job)` at every change, `lost(problem)` when there is none of this id.
 * Return `take(job)`, for a newer state of it that came as the answer to something else.
 */
export function follow(id, { show, lost }, signal) {
  const path = `v1/jobs/${encodeURIComponent(id)}`;
  let known = null;

  function take(job) {
    if (known !== null && job.version < known.version) return;
    known = job;
    show(job);
  }

  async function look() {
    const headers = known === null ? {} : { "If-None-Match": `"${known.version}"` };
    const answer = await ask(path, { headers, signal });
    if (answer.status !== 304) take(await answer.json());
  }

  async function round() {
    // What the events told of a job is not all of it: the whole is looked at, and then after each step.
    await look();
    if (ended(known)) return RESTING;
    for await (const event of events(`${path}/events`, known.version, signal)) {
      if (event.kind === "progress") take({ ...known, version: event.id, progress: event.data });
      else await look();
      if (ended(known)) break;
    }
    return 0;
  }

  const hurry = repeat(async () => {
    try {
      return await round();
    } catch (error) {
      if (error.status !== 404) throw error;
      lost(error);
      return Infinity;
    }
  }, signal);

  return (job) => {
    take(job);
    hurry();
  };
}
