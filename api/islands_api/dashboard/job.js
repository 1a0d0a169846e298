/** One job: how it stands, its course, what it found, what it works on, and what may be done with it. */

import { ask, download, json } from "./api.js";
import { clear, complain } from "./banner.js";
import { age, utc } from "./clock.js";
import { confirmed } from "./confirm.js";
import { course } from "./course.js";
import { datasetPanel, settingsPanel } from "./dataset.js";
import { diagnoses, findingsPanel } from "./diagnosis.js";
import { announce, el, facts, once, say } from "./dom.js";
import { modelsPanel } from "./models.js";
import { count, duration, number } from "./numbers.js";
import { badge, ended, nameOf, progressBar, standing } from "./state.js";
import { follow } from "./watch.js";

const path = (id) => `v1/jobs/${encodeURIComponent(id)}`;

async function removed(job) {
  const found = diagnoses(job) ? "findings and report" : "models, figures and history";
  const text = `${nameOf(job)} goes with its ${found}. This cannot be undone.`;
  if (!(await confirmed("Delete this job?", text, "Delete it"))) return null;
  await ask(path(job.id), { method: "DELETE" });
  location.hash = "#/jobs";
  return null;
}

/** What may be done with a job: when, and how. Each returns the job as it is then, or null. */
const ACTIONS = [
  {
    name: "Cancel",
    when: (job) => !ended(job) && !job.cancel_requested,
    act: (job) => json(`${path(job.id)}/cancel`, { method: "POST" }),
  },
  {
    name: "Resume",
    when: (job) => ["failed", "cancelled"].includes(job.state),
    act: (job) => json(`${path(job.id)}/resume`, { method: "POST" }),
  },
  {
    name: "Save the result",
    when: (job) => job.state === "succeeded",
    act: (job) => download(`${path(job.id)}/result`, `result-${job.id.slice(0, 8)}.json`).then(() => null),
  },
  { name: "Delete", danger: true, when: ended, act: removed },
];

/** Make the buttons; `take(job)` hears of what an action made of the job. */
function actions(take, heading) {
  let job = null;
  const press = ({ act }) =>
    once(async () => {
      clear("problem");
      try {
        const changed = await act(job);
        if (changed !== null) take(changed);
      } catch (error) {
        complain(error);
      }
    });
  const buttons = ACTIONS.map((action) =>
    el(
      "button",
      { type: "button", hidden: true, class: action.danger ? "danger" : null, on: { click: press(action) } },
      action.name,
    ),
  );
  return {
    node: el("div", { class: "row actions" }, buttons),
    show(now) {
      job = now;
      buttons.forEach((button, at) => {
        const had = button === document.activeElement;
        button.hidden = !ACTIONS[at].when(job);
        if (had && button.hidden) heading.focus({ preventScroll: true });
      });
    },
  };
}

const seconds = (job) => (Date.parse(job.finished ?? job.updated) - Date.parse(job.started)) / 1000;

function told(job, unit) {
  const progress = job.progress ?? {};
  const { best_error: best, seconds_left: left, evaluations_per_second: rate } = progress;
  const running = job.state === "running";
  return facts([
    ["Best error", Number.isFinite(best) ? el("data", { value: best }, `${number(best)} ${unit}`) : null],
    ["Evaluations", progress.evaluations === undefined ? null : count(progress.evaluations)],
    ["Per second", running && rate ? count(rate) : null],
    ["Time left", running && Number.isFinite(left) ? `about ${duration(left)}` : null],
    ["Took", job.finished && job.started ? duration(seconds(job)) : null],
    ["Ended by", job.summary?.ended_by],
    ["Attempt", job.attempt > 1 ? String(job.attempt) : null],
    ["Priority", job.priority ? String(job.priority) : null],
    ["Submitted", age(job.created)],
    ["Started", job.started && utc(job.started)],
    ["Finished", job.finished && utc(job.finished)],
  ]);
}

function failure(job) {
  if (job.state !== "failed" || !job.problem) return null;
  const { title, detail } = job.problem;
  const heading = el("h2", {}, title ?? "The job failed");
  return el("section", { class: "card failure" }, heading, el("p", {}, detail ?? ""));
}

/** Show a job in a host until the signal aborts; `update({rank})` shows another of its models. */
export function mountJob(host, { id, rank }, signal) {
  const heading = el("h1", { tabindex: "-1" }, "Job");
  const state = badge();
  const bar = progressBar();
  const standingFacts = el("div");
  const trouble = el("div");
  const [courseHost, modelsHost, about] = [el("div"), el("div"), el("div", { class: "about" })];
  const head = el(
    "div",
    { class: "heading" },
    el("div", { class: "title" }, heading, state.node),
    el("code", { class: "soft small" }, id),
  );
  let [shown, unit, search, models] = [null, "", null, null];

  function build(job) {
    const known = (found) => {
      unit = found;
      if (diagnoses(job)) return;
      search = course(id, unit, signal);
      courseHost.replaceChildren(search.node);
      if (shown) show(shown);
    };
    about.replaceChildren(settingsPanel(job.spec), datasetPanel(job.spec, known, signal));
    host.replaceChildren(
      el("a", { class: "back", href: "#/jobs" }, "← Jobs"),
      head,
      buttons.node,
      el("section", { class: "card stand", "aria-label": "Progress" }, bar.node, standingFacts),
      trouble,
      courseHost,
      modelsHost,
      about,
    );
  }

  function show(job) {
    if (shown === null) build(job);
    else if (standing(job) !== standing(shown)) announce(`${nameOf(job)}: ${standing(job)}`);
    shown = job;
    document.title = `${nameOf(job)} · islands`;
    say(heading, nameOf(job));
    state.show(job);
    bar.show(job);
    buttons.show(job);
    standingFacts.replaceChildren(told(job, unit));
    trouble.replaceChildren(...[failure(job)].filter(Boolean));
    search?.advance(job);
    if (diagnoses(job)) {
      // Kept as it is: a button in it may have the focus.
      const wanted = job.state === "succeeded";
      if (wanted !== modelsHost.hasChildNodes())
        modelsHost.replaceChildren(...(wanted ? [findingsPanel(job)] : []));
    } else if (job.state === "succeeded" && models === null) {
      models = modelsPanel(job, rank, signal);
      modelsHost.replaceChildren(models.node);
    }
  }

  function lost(problem) {
    document.title = "No such job · islands";
    host.replaceChildren(
      el("h1", { tabindex: "-1" }, "There is no such job"),
      el("p", {}, problem.message),
      el("p", {}, el("a", { href: "#/jobs" }, "Show all jobs")),
    );
  }

  const take = follow(id, { show, lost }, signal);
  const buttons = actions(take, heading);
  host.replaceChildren(el("p", { class: "waiting" }, "Asking the service…"));
  return {
    update(details) {
      rank = details.rank;
      models?.select(rank);
    },
  };
}
