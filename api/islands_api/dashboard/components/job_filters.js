/** Filters of the list of jobs, which are in the address: state, kind, tag and words. */

import { el } from "../lib/dom.js";
import { STATES } from "./job_state.js";
import { KINDS } from "./job_words.js";

/** Milliseconds after the last key until a search starts. */
const TYPING_MS = 250;

/** Return the address of the list with some filters; empty ones are left out. */
export function makeJobsAddress(filters = {}) {
  const query = new URLSearchParams(Object.entries(filters).filter(([, value]) => value));
  return query.size ? `#/jobs?${query}` : "#/jobs";
}

/** Make the filters until the signal aborts; `show(filters)` updates them to those of the address. */
export function makeJobFilters(signal) {
  const states = el("nav", { class: "filters", "aria-label": "Jobs by state" });
  const kind = el(
    "select",
    { "aria-label": "Kind" },
    el("option", { value: "" }, "all kinds"),
    Object.entries(KINDS).map(([value, text]) => el("option", { value }, text)),
  );
  const search = el("input", {
    ...{ type: "search", maxlength: 200, placeholder: "Search", "aria-label": "Search" },
    title: "Words in the name, tags, data set, equation or verdict",
  });
  const tag = el("span", { class: "tags" });
  let [current, timer] = [{}, null];

  /** Change the address without a further entry of the history while the user types. */
  function type() {
    clearTimeout(timer);
    timer = setTimeout(() => {
      timer = null;
      location.replace(makeJobsAddress({ ...current, q: search.value.trim(), cursor: "" }));
    }, TYPING_MS);
  }
  search.addEventListener("input", type);
  signal.addEventListener("abort", () => clearTimeout(timer));
  kind.addEventListener("change", () => {
    location.hash = makeJobsAddress({ ...current, kind: kind.value, cursor: "" });
  });

  function show(filters) {
    current = filters;
    const { state = "", q = "" } = filters;
    const makeLink = (name, value) => {
      const href = makeJobsAddress({ ...filters, state: value, cursor: "" });
      return el("a", { href, "aria-current": value === state ? "page" : null }, name);
    };
    const hadFocus = states.contains(document.activeElement);
    states.replaceChildren(makeLink("all", ""), ...STATES.map((each) => makeLink(each, each)));
    if (hadFocus) states.querySelector("[aria-current]").focus();
    kind.value = filters.kind ?? "";
    // While the user types, the text is newer than the address.
    if (timer === null && search.value.trim() !== q) search.value = q;
    const href = makeJobsAddress({ ...filters, tag: "", cursor: "" });
    const label = `Tag ${filters.tag}: show jobs with and without it`;
    const link = () => el("a", { class: "tag chosen", href, "aria-label": label }, filters.tag, " ×");
    tag.replaceChildren(...(filters.tag ? [link()] : []));
  }

  return {
    nodes: [states, el("div", { class: "row search-jobs", role: "search" }, tag, kind, search)],
    show,
  };
}
