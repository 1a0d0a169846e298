/** Page of a job: state, convergence, result, data set, settings and actions. */

import { clearBanner, showProblem } from "../components/banner.js";
import { makeRunAgainLink } from "../components/compare_choice.js";
import { askConfirmation } from "../components/confirm.js";
import { makeConvergencePanel } from "../components/convergence.js";
import { makeDatasetPanel, makeSettingsPanel } from "../components/dataset.js";
import { makeFindingsPanels } from "../components/diagnosis.js";
import { canResume, makeFailureCard } from "../components/job_failure.js";
import { makeRenameButton, makeTagEditor } from "../components/job_labels.js";
import {
  getIsolatedName,
  getName,
  getState,
  isEnded,
  makeBadge,
  makeProgressBar,
} from "../components/job_state.js";
import { makePhasePanel } from "../components/job_phase.js";
import { isDiagnosis, isSearch } from "../components/job_words.js";
import { makeModelsPanel } from "../components/models.js";
import { makeResultCard } from "../components/result_card.js";
import { makeLivePanel } from "../components/size_front.js";
import { download, getJobPath, getJson, sendRequest } from "../lib/api.js";
import { formatUtc, makeAge, makeCountdown } from "../lib/clock.js";
import { announce, el, makeFacts, runOnceAtATime, setText } from "../lib/dom.js";
import { formatCount, formatDuration, formatNumber } from "../lib/numbers.js";
import { followJob } from "../lib/polling.js";


async function deleteJob(job) {
  const contents = isSearch(job) ? "models, figures and history" : "findings and report";
  const text = `${getIsolatedName(job)} is deleted with its ${contents}. This cannot be undone.`;
  if (!(await askConfirmation("Delete this job?", text, "Delete it"))) return null;
  await sendRequest(getJobPath(job.id), { method: "DELETE" });
  location.hash = "#/jobs";
  return null;
}

/** Return whether a job evolves models: those of other classes than NARX are fitted. */
const isEvolution = (job) => isSearch(job) && (job.spec.model ?? "narx") === "narx";

/** Return whether the search of a job can end early with its best models. */
const canStop = (job) =>
  job.state === "running" && isEvolution(job) && !job.cancel_requested && !job.stop_requested;

/** Return whether a search is about to end early: its time left does not count then. */
const isStopping = ({ stop_requested: stopped, progress }) => stopped && progress?.phase === "search";

/** Actions on a job: name, condition and function, which returns the changed job or null. */
const ACTIONS = [
  {
    name: "Stop and keep the best",
    when: (job) => canStop(job),
    act: (job) => getJson(`${getJobPath(job.id)}/stop`, { method: "POST" }),
  },
  {
    name: "Cancel",
    when: (job) => !isEnded(job) && !job.cancel_requested,
    act: (job) => getJson(`${getJobPath(job.id)}/cancel`, { method: "POST" }),
  },
  {
    name: "Resume",
    when: canResume,
    act: (job) => getJson(`${getJobPath(job.id)}/resume`, { method: "POST" }),
  },
  {
    name: "Save the result",
    when: (job) => job.state === "succeeded",
    act: (job) =>
      download(`${getJobPath(job.id)}/result`, `result-${job.id.slice(0, 8)}.json`).then(() => null),
  },
  { name: "Delete", danger: true, when: isEnded, act: deleteJob },
];

/** Make the buttons; `updateJob(job)` receives the job that an action has changed. */
function makeActions(updateJob, heading) {
  let job = null;
  const makeHandler = ({ act }) =>
    runOnceAtATime(async () => {
      clearBanner("problem");
      try {
        const changed = await act(job);
        if (changed !== null) updateJob(changed);
      } catch (error) {
        showProblem(error);
      }
    });
  const buttons = ACTIONS.map((action) =>
    el(
      "button",
      {
        type: "button",
        hidden: true,
        class: action.danger ? "danger" : null,
        on: { click: makeHandler(action) },
      },
      action.name,
    ),
  );
  return {
    node: el("div", { class: "row actions" }, buttons),
    show(newJob) {
      job = newJob;
      buttons.forEach((button, at) => {
        const hadFocus = button === document.activeElement;
        button.hidden = !ACTIONS[at].when(job);
        if (hadFocus && button.hidden) heading.focus({ preventScroll: true });
      });
    },
  };
}

const getSeconds = (job) => (Date.parse(job.finished ?? job.updated) - Date.parse(job.started)) / 1000;

/** Format the run time of all attempts and its limit; null before the first attempt. */
function formatRunTime({ state, started, run_seconds: counted, max_run_seconds: limit, loaded }) {
  if (!started || !Number.isFinite(counted)) return null;
  // Progress events do not contain the run time.
  const since = state === "running" ? (performance.now() - loaded) / 1000 : 0;
  const written = formatDuration(counted + since);
  return Number.isFinite(limit) ? `${written} (limit ${formatDuration(limit)})` : written;
}

const hasSeveralOutputs = ({ spec }) => Array.isArray(spec.output);

function makeJobFacts(job, unit) {
  const progress = job.progress ?? {};
  const { best_error: best, seconds_left: left, evaluations_per_second: rate } = progress;
  const running = job.state === "running";
  const bestError = Number.isFinite(best) && !hasSeveralOutputs(job)
    ? el("data", { value: best }, `${formatNumber(best)} ${unit}`)
    : null;
  return makeFacts([
    [running ? "Best error" : "Best error of the search", bestError],
    ["Evaluations", progress.evaluations === undefined ? null : formatCount(progress.evaluations)],
    ["Per second", running && rate ? formatCount(rate) : null],
    ["Time left", running && Number.isFinite(left) && !isStopping(job) ? makeCountdown(left) : null],
    ["Run time", formatRunTime(job)],
    ["Note", running && progress.note ? progress.note : null],
    ["Warning", progress.warnings?.join("; ")],
    ["Duration", job.finished && job.started ? formatDuration(getSeconds(job)) : null],
    ["Ended by", job.summary?.ended_by],
    ["Attempt", job.attempt > 1 ? String(job.attempt) : null],
    ["Priority", job.priority ? String(job.priority) : null],
    ["Submitted", makeAge(job.created)],
    ["Started", job.started && formatUtc(job.started)],
    ["Finished", job.finished && formatUtc(job.finished)],
  ]);
}

/** Show a job in a host until the signal aborts; `update({rank})` shows another model. */
export function mountJob(host, { id, rank }, signal) {
  const name = el("bdi", {}, "Job");
  const heading = el("h1", { tabindex: "-1" }, name);
  const state = makeBadge();
  const bar = makeProgressBar();
  const phase = makePhasePanel();
  const factsHost = el("div");
  const failureHost = el("div");
  const [resultHost, convergenceHost, modelsHost] = [el("div", { class: "stack" }), el("div"), el("div")];
  const aboutHost = el("div", { class: "about" });
  const changed = (job) => updateJob({ ...current, ...job });
  const rename = makeRenameButton(heading, { getJob: () => current, changed });
  const tags = makeTagEditor({ changed });
  const titleBar = el(
    "div",
    { class: "heading" },
    el("div", { class: "title" }, heading, rename.node, state.node, tags.node),
    el("code", { class: "soft small" }, id),
  );
  const status = el(
    "section",
    { class: "card status", "aria-label": "Progress" },
    phase.node,
    bar.node,
    factsHost,
  );
  let [current, unit, columns, convergence, live, models] = [null, null, [], null, null, null];

  function build(job) {
    const onUnitKnown = (value, found) => {
      [unit, columns] = [value, found];
      // The errors of several outputs have no common scale; models of other classes are not evolved.
      if (isEvolution(job) && !hasSeveralOutputs(job)) {
        convergence = makeConvergencePanel(id, unit, signal);
        live = makeLivePanel(job, unit, signal);
        convergenceHost.replaceChildren(live.node, convergence.node);
      }
      if (isSearch(job) && current) show(current);
    };
    aboutHost.replaceChildren(makeSettingsPanel(job.spec), makeDatasetPanel(job.spec, onUnitKnown, signal));
    buttons.node.append(makeRunAgainLink(job) ?? "");
    host.replaceChildren(
      el("a", { class: "back", href: "#/jobs" }, "← Jobs"),
      titleBar,
      buttons.node,
      resultHost,
      failureHost,
      status,
      convergenceHost,
      modelsHost,
      aboutHost,
    );
  }

  function show(job) {
    if (current === null) build(job);
    else if (getState(job) !== getState(current)) announce(`${getIsolatedName(job)}: ${getState(job)}`);
    current = job;
    document.title = `${getName(job)} · islands`;
    setText(name, getName(job));
    rename.show(getIsolatedName(job));
    tags.show(job);
    state.show(job);
    phase.show(job);
    bar.show(job, !phase.node.hidden);
    buttons.show(job);
    factsHost.replaceChildren(makeJobFacts(job, unit ?? ""));
    showResult(job);
    failureHost.replaceChildren(...[makeFailureCard(job)].filter(Boolean));
    draw(job);
    convergence?.show(job);
    live?.show(job);
    if (!isSearch(job)) {
      // Not replaced if present: a button in it may have the focus.
      const succeeded = job.state === "succeeded";
      const findingsHost = isDiagnosis(job) ? resultHost : modelsHost;
      if (succeeded !== findingsHost.hasChildNodes())
        findingsHost.replaceChildren(...(succeeded ? makeFindingsPanels(job, signal) : []));
    } else if (job.state === "succeeded" && models === null && (unit !== null || hasSeveralOutputs(job))) {
      models = makeModelsPanel(job, rank, unit, signal);
      // A reader of a result wants its models before the course of the search.
      status.before(modelsHost);
      modelsHost.replaceChildren(models.node);
    }
  }

  /** Draw the lines that grow with the search. */
  function draw(job) {
    convergence?.draw(job);
    live?.draw(job);
  }

  /** Show the recommended model as soon as the unit of its output is known. */
  function showResult(job) {
    if (unit === null || job.state !== "succeeded" || resultHost.hasChildNodes()) return;
    // Results of earlier versions name no recommended model; several outputs have another panel.
    if (isSearch(job) && !hasSeveralOutputs(job) && job.summary?.rank)
      resultHost.replaceChildren(makeResultCard(job, unit, columns, signal));
  }

  function lost(problem) {
    document.title = "No such job · islands";
    host.replaceChildren(
      el("h1", { tabindex: "-1" }, "There is no such job"),
      el("p", {}, problem.message),
      el("p", {}, el("a", { href: "#/jobs" }, "Show all jobs")),
    );
  }

  const updateJob = followJob(id, { show, draw, lost }, signal);
  const buttons = makeActions(updateJob, heading);
  host.replaceChildren(el("p", { class: "loading" }, "Loading…"));
  return {
    update(details) {
      rank = details.rank;
      models?.select(rank);
    },
  };
}
