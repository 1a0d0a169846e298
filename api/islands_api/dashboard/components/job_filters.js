/** Filters of the list of jobs, which are in the address: state, kind, tag, words, and owner. */

import { getJson } from "../lib/api.js";
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

/** Value of the filter for the jobs of all owners. */
export const ALL = "*";

/**
 * Make the choice of an owner; it is shown if the key may see the jobs of several owners. `onChange(owner)`
 * is called with its name, `ALL`, or an empty text for the jobs of the key.
 */
function makeOwnerChoice(onChange, signal) {
  const node = el("select", { "aria-label": "Owner", hidden: true });
  node.addEventListener("change", () => onChange(node.value));
  let owner = "";

  async function load() {
    const { scopes } = await getJson("v1/caller", { signal });
    if (!scopes.includes("admin")) return;
    const { items } = await getJson("v1/admin/owners", { signal });
    const names = items.map(({ name }) => [name, name]);
    const options = [["", "my jobs"], [ALL, "all owners"], ...names];
    node.replaceChildren(...options.map(([value, text]) => el("option", { value }, text)));
    node.value = owner;
    node.hidden = names.length < 2;
  }

  // The list shows the problem of an unavailable service.
  load().catch(() => null);
  return {
    node,
    show(newOwner) {
      owner = newOwner;
      node.value = owner;
    },
  };
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
  const owners = makeOwnerChoice((owner) => {
    location.hash = makeJobsAddress({ owner, state: current.state });
  }, signal);
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
    owners.show(filters.owner ?? "");
    // The list of all owners has no other filters.
    for (const node of [kind, search]) node.hidden = Boolean(filters.owner);
    kind.value = filters.kind ?? "";
    // While the user types, the text is newer than the address.
    if (timer === null && search.value.trim() !== q) search.value = q;
    const href = makeJobsAddress({ ...filters, tag: "", cursor: "" });
    const label = `Tag ${filters.tag}: show jobs with and without it`;
    const link = () => el("a", { class: "tag chosen", href, "aria-label": label }, filters.tag, " ×");
    tag.replaceChildren(...(filters.tag ? [link()] : []));
  }

  return {
    nodes: [states, el("div", { class: "row search-jobs", role: "search" }, tag, owners.node, kind, search)],
    show,
  };
}
