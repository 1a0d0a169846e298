/** Jobs that are selected in the list, and what is done with all of them: compare, cancel, delete. */

import { getJobPath, sendRequest } from "../lib/api.js";
import { announce, el, runOnceAtATime, setText } from "../lib/dom.js";
import { clearBanner, showProblem } from "./banner.js";
import { askConfirmation } from "./confirm.js";
import { getIsolatedName, isEnded } from "./job_state.js";
import { isSearch } from "./job_words.js";

const count = (jobs) => `${jobs.length} ${jobs.length === 1 ? "job" : "jobs"}`;
const isComparable = (job) => isSearch(job) && job.state === "succeeded";

/** Send a request for each job, one after the other; return the jobs that it succeeded for. */
async function sendForEach(jobs, send) {
  clearBanner("problem");
  const [done, problems] = [[], []];
  for (const job of jobs) {
    try {
      await send(job);
      done.push(job);
    } catch (error) {
      problems.push(error);
    }
  }
  const message = problems.map((error) => error.message).join("\n");
  if (problems.length) showProblem({ ...problems[0], message });
  return done;
}

/** Make the selection; `refresh()` loads the list again after a change. */
export function makeJobSelection({ refresh }) {
  const [chosen, boxes] = [new Map(), new Map()];
  const all = el("input", { type: "checkbox", "aria-label": "Select all jobs of this page" });
  const text = el("strong");
  const compare = el("a", { class: "button" }, "Compare");
  const act = (action) => ({ click: runOnceAtATime(action) });
  const cancel = el("button", { type: "button", on: act(cancelAll) });
  const remove = el("button", { type: "button", class: "danger", on: act(deleteAll) });
  const clear = el("button", { type: "button", class: "quiet", on: { click: () => choose([]) } }, "Clear");
  const bar = el(
    "div",
    { class: "card row selection", role: "group", "aria-label": "Selected jobs", hidden: true },
    ...[text, compare, cancel, remove, clear],
  );

  const list = (condition) => [...chosen.values()].filter(condition);
  const listActive = () => list((job) => !isEnded(job) && !job.cancel_requested);

  function update() {
    const [active, ended, models] = [listActive(), list(isEnded), list(isComparable)];
    const hadFocus = bar.contains(document.activeElement);
    bar.hidden = chosen.size === 0;
    if (bar.hidden && hadFocus) all.focus({ preventScroll: true });
    setText(text, `${count([...chosen])} selected`);
    compare.hidden = models.length < 2;
    compare.href = `#/compare?jobs=${models.map(({ id }) => id).join()}`;
    cancel.hidden = active.length === 0;
    setText(cancel, `Cancel ${count(active)}`);
    remove.hidden = ended.length === 0;
    setText(remove, `Delete ${count(ended)}`);
    for (const [id, { node }] of boxes) node.checked = chosen.has(id);
    all.checked = boxes.size > 0 && chosen.size === boxes.size;
    all.indeterminate = chosen.size > 0 && !all.checked;
  }

  function choose(jobs) {
    chosen.clear();
    for (const job of jobs) chosen.set(job.id, job);
    update();
  }

  async function cancelAll() {
    const cancelJob = (job) => sendRequest(`${getJobPath(job.id)}/cancel`, { method: "POST" });
    const done = await sendForEach(listActive(), cancelJob);
    announce(`${count(done)} cancelled`);
    choose([]);
    refresh();
  }

  async function deleteAll() {
    const [ended, kept] = [list(isEnded), list((job) => !isEnded(job))];
    const which = ended.length === 1 ? getIsolatedName(ended[0]) : count(ended);
    const rest = kept.length ? ` Kept, since not ended: ${count(kept)} of the selection.` : "";
    const result = `${which} will be deleted with all results. This cannot be undone.${rest}`;
    const action = `Delete ${count(ended)}`;
    const refusal = ended.length === 1 ? "Keep it" : "Keep them";
    if (!(await askConfirmation(`${action}?`, result, action, refusal))) return;
    const done = await sendForEach(ended, (job) => sendRequest(getJobPath(job.id), { method: "DELETE" }));
    announce(`${count(done)} deleted`);
    choose([]);
    refresh();
  }

  all.addEventListener("change", () => {
    const jobs = [...boxes.values()].map(({ job }) => job);
    choose(all.checked ? jobs : []);
  });

  return {
    all,
    bar,
    isEmpty: () => chosen.size === 0,
    /** Make the check box of a job. */
    makeBox(job) {
      const node = el("input", { type: "checkbox" });
      node.addEventListener("change", () => {
        if (node.checked) chosen.set(job.id, boxes.get(job.id).job);
        else chosen.delete(job.id);
        update();
      });
      return node;
    },
    /** Take the newest state of a job of the page, and its check box. */
    show(job, node) {
      boxes.set(job.id, { job, node });
      node.setAttribute("aria-label", `Select ${getIsolatedName(job)}`);
      if (chosen.has(job.id)) chosen.set(job.id, job);
    },
    /** Forget jobs that are no longer on the page. */
    keep(ids) {
      for (const id of [...boxes.keys()]) {
        if (ids.has(id)) continue;
        boxes.delete(id);
        chosen.delete(id);
      }
      update();
    },
  };
}
