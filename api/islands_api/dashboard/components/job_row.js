/** Row of a job in the list: the row is a link, with the name, the tags and the check box as controls. */

import { makeAge } from "../lib/clock.js";
import { announce, el, setText } from "../lib/dom.js";
import { NONE, formatNumber, formatPercent } from "../lib/numbers.js";
import { makeRenameButton, makeTags } from "./job_labels.js";
import { getIsolatedName, getName, getState, makeBadge, makeProgressBar } from "./job_state.js";
import { describeJob, getFinding, getVerdict } from "./job_words.js";

/** Describe the error of a search that has no result yet, in the unit of the output. */
function describeBest({ state, progress }) {
  const best = progress?.best_error;
  return state === "running" && Number.isFinite(best) ? `best error ${formatNumber(best)}` : "";
}

/** Make the outcome of a job: its progress, or its finding and its verdict. */
function makeOutcome() {
  const bar = makeProgressBar({ showsReason: true });
  const [finding, verdict] = [el("code", { class: "line" }), el("span", { class: "small verdict" })];
  return {
    nodes: [bar.node, finding, verdict],
    show(job) {
      bar.show(job);
      setText(finding, getFinding(job));
      finding.title = finding.textContent;
      setText(verdict, getVerdict(job) || describeBest(job));
      for (const node of [finding, verdict]) node.hidden = !node.textContent;
      bar.node.hidden = job.state === "succeeded" && !(finding.hidden && verdict.hidden);
    },
  };
}

/** Show a value, or a dash, which a narrow screen leaves out. */
function showFigure(cell, text) {
  setText(cell, text);
  cell.classList.toggle("none", text === NONE);
}

/**
 * Make the row of a job; `show(job)` updates it and announces a change of state to screen readers. With
 * `showsOwner` it has the owner; a job of another owner than `self` is neither opened nor changed.
 */
export function makeJobRow(job, selection, { showsOwner = false, self = null } = {}) {
  let current = job;
  const state = makeBadge();
  const outcome = makeOutcome();
  const box = selection.makeBox(job);
  const name = el("bdi");
  const isForeign = showsOwner && job.owner !== self;
  const link = el("a", isForeign ? {} : { href: `#/jobs/${job.id}` }, name);
  const rename = makeRenameButton(link, { getJob: () => current, changed: show });
  const [about, tags] = [el("span", { class: "about-job soft small" }), makeTags()];
  const [error, size] = ["error", "size"].map((label) =>
    el("td", { class: "figure", "data-label": label }));
  let lastState = null;
  const node = el(
    "tr",
    { "data-job": job.id },
    el("td", { class: "choice" }, isForeign ? null : el("label", {}, box)),
    el("td", {}, state.node),
    el(
      "th",
      { scope: "row" },
      el("div", { class: "name" }, link, isForeign ? null : rename.node),
      el("div", { class: "details" }, about, tags.node),
    ),
    el("td", { class: "wide" }, outcome.nodes),
    error,
    size,
    el("td", { class: "figure" }, makeAge(job.created)),
  );

  function show(newJob) {
    if (newJob.version < current.version) return;
    current = newJob;
    state.show(newJob);
    outcome.show(newJob);
    tags.show(newJob);
    rename.show(getIsolatedName(newJob));
    if (!isForeign) selection.show(newJob, box);
    setText(name, getName(newJob));
    setText(about, describeJob(newJob, showsOwner));
    showFigure(error, formatPercent(newJob.summary?.metrics?.mape));
    showFigure(size, newJob.summary?.size ? String(newJob.summary.size) : NONE);
    const newState = getState(newJob);
    if (lastState !== null && lastState !== newState) announce(`${getIsolatedName(newJob)}: ${newState}`);
    lastState = newState;
  }
  show(job);
  return { node, show };
}

const CONTROLS = "a, button, input, label, form, select";

/** Let a click anywhere in a row follow its link, as a click on the link would. */
export function followRows(host) {
  function follow(event) {
    const row = event.target.closest("tr[data-job]");
    if (!row || event.target.closest(CONTROLS) || !getSelection().isCollapsed) return;
    const link = row.querySelector("th a[href]");
    if (!link) return;
    if (event.button === 1 || event.ctrlKey || event.metaKey) open(link.href, "_blank", "noopener");
    else if (event.button === 0) link.click();
  }
  host.addEventListener("click", follow);
  host.addEventListener("auxclick", (event) => event.button === 1 && follow(event));
}
