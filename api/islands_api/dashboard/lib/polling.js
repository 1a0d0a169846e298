/** Polling of the service, and following a job or a monitor. */

import { clearBanner, showProblem } from "../components/banner.js";
import { isEnded } from "../components/job_state.js";
import {
  Problem,
  Unavailable,
  getJobPath,
  makeBackoff,
  sendRequest,
  sleep,
  streamEvents,
} from "./api.js";
import { limitRate } from "./clock.js";

/** Seconds between two requests for a job that has ended, because another client may resume it. */
const ENDED_POLL_SECONDS = 5;

/** Minimum number of seconds until the next attempt after a problem. */
const PROBLEM_RETRY_SECONDS = 5;

/** Seconds between two requests for a monitor while records are analysed, and otherwise. */
const [ANALYSIS_POLL_SECONDS, MONITOR_POLL_SECONDS] = [1, 4];

function waitUntilVisible(signal) {
  return new Promise((resolve) => {
    const check = () => {
      if (document.hidden && !signal.aborted) return;
      document.removeEventListener("visibilitychange", check);
      signal.removeEventListener("abort", check);
      resolve();
    };
    document.addEventListener("visibilitychange", check);
    signal.addEventListener("abort", check);
    check();
  });
}

/**
 * Repeat a task until the signal aborts. The task returns the seconds until its next run, or Infinity to end.
 * Hidden pages are not polled. Return a function that runs the task immediately.
 */
export function poll(task, signal) {
  const backoff = makeBackoff();
  let wake = new AbortController();
  async function runOnce() {
    try {
      const seconds = await task();
      backoff.reset();
      clearBanner("poll");
      return seconds;
    } catch (error) {
      if (signal.aborted || error.status === 401) return Infinity;
      if (error instanceof Unavailable) return backoff.next();
      showProblem(error, "poll");
      if (error instanceof Problem) return Math.max(PROBLEM_RETRY_SECONDS, error.wait);
      throw error;
    }
  }
  async function run() {
    for (;;) {
      const seconds = await runOnce();
      if (seconds === Infinity) return;
      await sleep(seconds, AbortSignal.any([signal, wake.signal]));
      wake = new AbortController();
      await waitUntilVisible(signal);
      if (signal.aborted) return;
    }
  }
  run();
  signal.addEventListener("abort", () => clearBanner("poll"), { once: true });
  return () => wake.abort();
}

/**
 * Follow a job: call `show(job)` at each change of its state, and `lost(problem)` if the job does not exist.
 * Progress calls `draw(job)` once in a frame of the screen, and `show(job)` as often as texts can be read.
 * The time of `performance.now()` at which the whole job was received is its `loaded`.
 * Return a function that takes a newer state of the job, received as the response to another request.
 */
export function followJob(id, { show, draw, lost }, signal) {
  const path = getJobPath(id);
  let [current, frame] = [null, 0];

  function update(job) {
    if (current !== null && job.version < current.version) return;
    current = { loaded: performance.now(), ...job };
    show(current);
  }

  const showSoon = limitRate(() => show(current), signal);

  function drawNow() {
    frame = 0;
    if (!signal.aborted) draw(current);
  }

  /** Take a progress event; all before a frame of the screen are one drawing. A hidden page has no frames. */
  function updateProgress({ id: version, data: progress }) {
    if (version < current.version) return;
    current = { ...current, version, progress };
    showSoon();
    frame ||= requestAnimationFrame(drawNow);
  }

  async function check() {
    const headers = current === null ? {} : { "If-None-Match": `"${current.version}"` };
    const response = await sendRequest(path, { headers, signal });
    if (response.status !== 304) update(await response.json());
  }

  async function followUntilEnd() {
    // Progress events contain only a part of a job: load the whole job first, and after each change of state.
    await check();
    if (isEnded(current)) return ENDED_POLL_SECONDS;
    for await (const event of streamEvents(`${path}/events`, current.version, signal)) {
      if (event.kind === "progress") updateProgress(event);
      else await check();
      if (isEnded(current)) break;
    }
    return 0;
  }

  const wake = poll(endIfLost(followUntilEnd, lost), signal);

  return (job) => {
    update(job);
    wake();
  };
}

/** Return a task that ends if its resource does not exist. */
const endIfLost = (task, lost) => async () => {
  try {
    return await task();
  } catch (error) {
    if (error.status !== 404) throw error;
    lost(error);
    return Infinity;
  }
};

/**
 * Follow the monitor at a path: await `show(monitor)` at each change, `lost(problem)` if it does not exist.
 * Return a function that asks for it immediately.
 */
export function followMonitor(path, { show, lost }, signal) {
  let [current, tag] = [null, null];

  async function check() {
    const headers = tag === null ? {} : { "If-None-Match": tag };
    const response = await sendRequest(path, { headers, signal });
    if (response.status !== 304) {
      const monitor = await response.json();
      if (!signal.aborted) await show(monitor);
      [current, tag] = [monitor, response.headers.get("etag")];
    }
    return current.pending ? ANALYSIS_POLL_SECONDS : MONITOR_POLL_SECONDS;
  }

  return poll(endIfLost(check, lost), signal);
}
