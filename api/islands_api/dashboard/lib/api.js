/** Requests to the service: authentication, problems as errors, and event streams that reconnect. */

import { synchronise } from "./clock.js";

const KEY_ITEM = "islands.key";

/** Idle seconds after which a stream is considered broken. The service sends a comment more often. */
const STREAM_TIMEOUT_SECONDS = 40;

/** Seconds between the first two attempts. */
const MIN_BACKOFF_SECONDS = 0.5;

/** Maximum number of seconds between two attempts. */
const MAX_BACKOFF_SECONDS = 5;

/** Dispatches `unavailable` (with the reason), `available`, and `unauthorised` if the service needs a key. */
export const connection = new EventTarget();

const dispatch = (kind, detail) => connection.dispatchEvent(new CustomEvent(kind, { detail }));

/** Problem document of the service (RFC 9457). */
export class Problem extends Error {
  constructor(status, problem, wait = 0) {
    super(problem.detail || problem.title || `the service answered ${status}`);
    this.status = status;
    this.title = problem.title || "The request failed";
    this.requestId = problem.request_id;
    this.wait = wait;
  }
}

/** The service does not answer, or cannot answer now: try again later. */
export class Unavailable extends Error {}

/** The key, kept until the tab is closed; never part of a URL. */
export const key = {
  get: () => sessionStorage.getItem(KEY_ITEM),
  set: (secret) => sessionStorage.setItem(KEY_ITEM, secret),
  forget: () => sessionStorage.removeItem(KEY_ITEM),
};

function reportUnavailable(reason) {
  dispatch("unavailable", reason);
  return new Unavailable(reason);
}

async function readProblem(response) {
  let problem;
  try {
    problem = await response.json();
  } catch {
    problem = { detail: `${response.status} ${response.statusText}` };
  }
  return new Problem(response.status, problem, Number(response.headers.get("retry-after")) || 0);
}

/**
 * Send a request, with the key if there is one.
 * @throws {Problem} if the service rejects the request
 * @throws {Unavailable} if the service, its database or the server behind a proxy does not answer
 */
export async function sendRequest(path, { headers = {}, signal, ...options } = {}) {
  const secret = key.get();
  const allHeaders = secret ? { ...headers, Authorization: `Bearer ${secret}` } : headers;
  let response;
  try {
    // The cookie is that of a proxy that logs users in and adds a token; the service itself has none.
    response = await fetch(path, { ...options, headers: allHeaders, signal, credentials: "same-origin" });
  } catch (error) {
    if (signal?.aborted) throw error;
    throw reportUnavailable("The service does not answer.");
  }
  // A response from the cache of the browser has an old date.
  if (!response.headers.get("cache-control")?.includes("immutable")) synchronise(response);
  if ([502, 503, 504].includes(response.status))
    throw reportUnavailable((await readProblem(response)).message);
  dispatch("available");
  if (response.ok || response.status === 304) return response;
  const problem = await readProblem(response);
  if (problem.status === 401) dispatch("unauthorised", problem);
  throw problem;
}

async function readBody(response, form, signal) {
  try {
    return await response[form]();
  } catch (error) {
    if (signal?.aborted || error instanceof SyntaxError) throw error;
    throw reportUnavailable("The connection was lost during a response.");
  }
}

/** Return the path of a job. */
export const getJobPath = (id) => `v1/jobs/${encodeURIComponent(id)}`;

/** Return the path of a data set. */
export const getDatasetPath = (id) => `v1/datasets/${encodeURIComponent(id)}`;

/** Request a JSON document. */
export const getJson = async (path, options = {}) =>
  readBody(await sendRequest(path, options), "json", options.signal);

/** Send a JSON document; return the one in the response. */
export const sendJson = (method, path, document, options = {}) =>
  getJson(path, {
    ...options,
    method,
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(document),
  });

/** Post a JSON document; return the one in the response. */
export const postJson = (path, document, options) => sendJson("POST", path, document, options);

/** Request text. */
export const getText = async (path, options = {}) =>
  readBody(await sendRequest(path, options), "text", options.signal);

/** Request bytes. */
export const getBlob = async (path, options = {}) =>
  readBody(await sendRequest(path, options), "blob", options.signal);

/** Save a response as a file; a plain link could not send the key. */
export async function download(path, name) {
  const response = await sendRequest(path);
  const match = /filename="([^"]+)"/.exec(response.headers.get("content-disposition") ?? "");
  saveBlob(await readBody(response, "blob"), match?.[1] ?? name);
}

/** Save bytes as a file. */
export function saveBlob(blob, name) {
  const url = URL.createObjectURL(blob);
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** Wait for some seconds, or until the signal aborts. */
export const sleep = (seconds, signal) =>
  new Promise((resolve) => {
    const end = () => {
      clearTimeout(timer);
      signal?.removeEventListener("abort", end);
      resolve();
    };
    const timer = setTimeout(end, 1000 * seconds);
    signal?.addEventListener("abort", end);
    if (signal?.aborted) end();
  });

/** Make an exponential backoff: `next()` returns the seconds to wait, `reset()` starts again. */
export function makeBackoff() {
  let seconds = MIN_BACKOFF_SECONDS;
  return {
    next: () => {
      const now = seconds;
      seconds = Math.min(2 * seconds, MAX_BACKOFF_SECONDS);
      return now;
    },
    reset: () => {
      seconds = MIN_BACKOFF_SECONDS;
    },
  };
}

/**
 * Yield events `{id, kind, data}` after an event number.
 * A broken or idle stream is reopened after its last event. The stream ends when the signal aborts or the
 * caller stops the iteration. `EventSource` is not used because it cannot send a key.
 */
export async function* streamEvents(path, last, signal) {
  const backoff = makeBackoff();
  while (!signal.aborted) {
    const attempt = new AbortController();
    const stop = () => attempt.abort();
    signal.addEventListener("abort", stop);
    try {
      const headers = { "Last-Event-ID": String(last) };
      const response = await sendRequest(path, { headers, signal: attempt.signal });
      for await (const event of parseEvents(readLines(response.body, stop))) {
        last = event.id;
        backoff.reset();
        yield event;
      }
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof Problem && error.status < 500) throw error;
    } finally {
      signal.removeEventListener("abort", stop);
      stop();
    }
    await sleep(backoff.next(), signal);
  }
}

async function* readLines(body, stop) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let remainder = "";
  for (;;) {
    const timer = setTimeout(stop, 1000 * STREAM_TIMEOUT_SECONDS);
    const { done, value } = await reader.read().finally(() => clearTimeout(timer));
    if (done) return;
    const lines = (remainder + value).split("\n");
    remainder = lines.pop();
    yield* lines;
  }
}

/** Parse the lines of a stream into events; comments are heartbeats and are skipped. */
export async function* parseEvents(source) {
  let event = {};
  for await (const line of source) {
    if (line === "") {
      const { id, event: kind, data } = event;
      if (data !== undefined) yield { id: Number(id), kind, data: JSON.parse(data) };
      event = {};
    } else if (!line.startsWith(":")) {
      const [, name, value] = /^([^:]*):? ?(.*)$/.exec(line);
      event[name] = name === "data" && event.data !== undefined ? `${event.data}\n${value}` : value;
    }
  }
}
