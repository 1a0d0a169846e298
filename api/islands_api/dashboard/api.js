/** Speaks to the service: requests with the key, problems as errors, streams that are taken up again. */

import { synchronise } from "./clock.js";

const STORED = "islands.key";

/** Seconds of silence after which a stream is taken for dead: the service says something every fifteen. */
const SILENCE = 40;

/** Seconds between two tries: at first, and at most. */
const BACKOFF = [0.5, 5];

/** Tells how the service is reached: `away` (with why), `back`, and `locked` when it wants a key. */
export const connection = new EventTarget();

const tell = (kind, detail) => connection.dispatchEvent(new CustomEvent(kind, { detail }));

/** What the service says is wrong (RFC 9457). */
export class Problem extends Error {
  constructor(status, document, wait = 0) {
    super(document.detail || document.title || `the service answered ${status}`);
    this.status = status;
    this.title = document.title || "Something is wrong";
    this.request = document.request_id;
    this.wait = wait;
  }
}

/** Nobody answers, or the service cannot answer now: it is worth another try. */
export class Away extends Error {}

/** The key, kept until this tab is closed; never part of an address. */
export const key = {
  get: () => sessionStorage.getItem(STORED),
  set: (secret) => sessionStorage.setItem(STORED, secret),
  forget: () => sessionStorage.removeItem(STORED),
};

function away(reason) {
  tell("away", reason);
  return new Away(reason);
}

async function problemOf(answer) {
  let said = {};
  try {
    said = await answer.json();
  } catch {
    said = { detail: `${answer.status} ${answer.statusText}` };
  }
  return new Problem(answer.status, said, Number(answer.headers.get("retry-after")) || 0);
}

/**
 * Send a request, with the key if there is one.
 * @throws {Problem} the service says no
 * @throws {Away} nobody answers, or the database or a proxy's other side does not
 */
export async function ask(path, { headers = {}, signal, ...options } = {}) {
  const secret = key.get();
  const sent = secret ? { ...headers, Authorization: `Bearer ${secret}` } : headers;
  let answer;
  try {
    answer = await fetch(path, { ...options, headers: sent, signal, credentials: "omit" });
  } catch (error) {
    if (signal?.aborted) throw error;
    throw away("The service does not answer.");
  }
  // What a browser has kept tells the time of long ago.
  if (!answer.headers.get("cache-control")?.includes("immutable")) synchronise(answer);
  if ([502, 503, 504].includes(answer.status)) throw away((await problemOf(answer)).message);
  tell("back");
  if (answer.ok || answer.status === 304) return answer;
  const problem = await problemOf(answer);
  if (problem.status === 401) tell("locked", problem);
  throw problem;
}

async function whole(answer, form, signal) {
  try {
    return await answer[form]();
  } catch (error) {
    if (signal?.aborted || error instanceof SyntaxError) throw error;
    throw away("The service broke off its answer.");
  }
}

/** Ask for a document. */
export const json = async (path, options = {}) => whole(await ask(path, options), "json", options.signal);

/** Ask for text. */
export const text = async (path, options = {}) => whole(await ask(path, options), "text", options.signal);

/** Ask for bytes. */
export const blob = async (path, options = {}) => whole(await ask(path, options), "blob", options.signal);

/** Save an answer as a file: a plain link could not send the key. */
export async function download(path, name) {
  const answer = await ask(path);
  const told = /filename="([^"]+)"/.exec(answer.headers.get("content-disposition") ?? "");
  const address = URL.createObjectURL(await whole(answer, "blob"));
  const link = document.createElement("a");
  link.href = address;
  link.download = told?.[1] ?? name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** Wait for some seconds, or until the signal aborts. */
export const pause = (seconds, signal) =>
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

/** Return what says how long to wait before the next try: twice as long each time, until reset. */
export function patience() {
  let seconds = BACKOFF[0];
  return {
    next: () => {
      const now = seconds;
      seconds = Math.min(2 * seconds, BACKOFF[1]);
      return now;
    },
    reset: () => {
      [seconds] = BACKOFF;
    },
  };
}

/**
 * Yield events as they happen, from behind an event's number on: `{id, kind, data}`.
 * A stream that is cut or silent is taken up again behind the last event; it ends with the signal, or when
 * whoever iterates has seen enough. `EventSource` cannot send a key.
 */
export async function* events(path, last, signal) {
  const tries = patience();
  while (!signal.aborted) {
    const attempt = new AbortController();
    const stop = () => attempt.abort();
    signal.addEventListener("abort", stop);
    try {
      const headers = { "Last-Event-ID": String(last) };
      const answer = await ask(path, { headers, signal: attempt.signal });
      for await (const event of parsed(lines(answer.body, stop))) {
        last = event.id;
        tries.reset();
        yield event;
      }
    } catch (error) {
      if (signal.aborted) return;
      if (error instanceof Problem && error.status < 500) throw error;
    } finally {
      signal.removeEventListener("abort", stop);
      stop();
    }
    await pause(tries.next(), signal);
  }
}

async function* lines(body, stop) {
  const reader = body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  for (;;) {
    const timer = setTimeout(stop, 1000 * SILENCE);
    const { done, value } = await reader.read().finally(() => clearTimeout(timer));
    if (done) return;
    const found = (rest + value).split("\n");
    rest = found.pop();
    yield* found;
  }
}

/** Put the lines of a stream together to events; comments only say that the service is alive. */
export async function* parsed(source) {
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
