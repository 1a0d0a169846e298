/** What a job does now, in words: the stages of its kind, and a sentence about the present step. */

import { announce, el, setText } from "../lib/dom.js";
import { formatCount } from "../lib/numbers.js";
import { getIsolatedName, getModelClass, isEnded } from "./job_state.js";
import { isDiagnosis, isSearch } from "./job_words.js";

/** Stages of a search, each with the beginnings of its phases. */
const SEARCH = [
  ["Record", ["loading", "reading"]],
  ["Preset", ["preset auto"]],
  ["First models", ["sampling rate", "forward selection", "swap search", "linear model of order"]],
  ["Search", ["search", "starting", "waiting"]],
  ["Final models", ["estimation", "final estimation", "choice of the equations", "refinement"]],
  ["Validation", ["assessment", "prediction bands"]],
  ["Result", ["storing"]],
];

const CLASS_FIT = SEARCH.filter(([name]) => !["Preset", "First models", "Search", "Result"].includes(name));

/** Stages of a diagnosis; its analysis has many phases. */
const DIAGNOSIS = [
  ["Record", ["loading", "reading", "starting"]],
  ["Calibration", ["calibrating", "looking for gross errors"]],
  ["Causes", [""]],
  ["Formula", ["a formula"]],
  ["Report", ["writing the report"]],
];

/** Phases whose reason is the note of the progress. */
const WAITING = ["starting", "waiting for capacity"];

const capitalise = (text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}`;

/** Split the phase of a search of several outputs: the beginning names the output. */
function splitPhase({ spec, progress }) {
  const phase = progress?.phase ?? "";
  const outputs = Array.isArray(spec.output) ? spec.output : [];
  const output = outputs.find((name) => phase.startsWith(`${name}: `));
  return output === undefined ? ["", phase] : [output, phase.slice(output.length + 2)];
}

function describeSearch(job) {
  const { generation, generations, islands = [] } = job.progress;
  const evolved = getModelClass(job) === "narx" ? "equations" : "state spaces";
  const where = islands.length > 1 ? ` on ${formatCount(islands.length)} islands` : "";
  const reached =
    generation === undefined ? "" : `: generation ${formatCount(generation)} of ${formatCount(generations)}`;
  return `Evolution of ${evolved}${where}${reached}.`;
}

/** Describe what a running job does now. */
export function describePhase(job) {
  const [output, phase] = splitPhase(job);
  const step = phase.replace(/^preset auto: /, "choice of the preset: ");
  let sentence = "Starting.";
  if (phase === "search") sentence = describeSearch(job);
  else if (phase) sentence = `${capitalise((WAITING.includes(phase) && job.progress.note) || step)}.`;
  const stopped = job.stop_requested ? " The search ends with its best models." : "";
  return `${output ? `${output}: ` : ""}${sentence}${stopped}`;
}

/** Return the stages of a job: a given preset is not chosen, and most classes of models are only fitted. */
function getStages({ kind, spec }) {
  if (isDiagnosis({ kind })) return DIAGNOSIS;
  const { model = "narx", preset = "auto" } = spec;
  if (!["narx", "latent"].includes(model)) return CLASS_FIT;
  return model === "narx" && preset === "auto" ? SEARCH : SEARCH.filter(([name]) => name !== "Preset");
}

/** Return the position of the present stage; the one with the longest beginning of the phase. */
function findStage(stages, phase) {
  if (!phase) return 0;
  const fits = stages.map(([, beginnings]) =>
    Math.max(-1, ...beginnings.filter((each) => phase.startsWith(each)).map((each) => each.length)));
  const best = Math.max(...fits);
  return best < 0 ? 0 : fits.indexOf(best);
}

/** Make the stages and the sentence of a running job; `show(job)` updates them. */
export function makePhasePanel() {
  const list = el("ol", { class: "stages", "aria-label": "Stages of the job" });
  const sentence = el("p", { class: "doing" });
  const node = el("div", { class: "phase", hidden: true }, list, sentence);
  let shown = null;
  function showStages(job, stages) {
    const at = findStage(stages, splitPhase(job)[1]);
    const name = stages[at][0];
    if (shown === name) return;
    if (shown !== null) announce(`${getIsolatedName(job)}: ${describePhase(job)}`);
    shown = name;
    list.replaceChildren(
      ...stages.map(([each], place) =>
        el(
          "li",
          { class: place < at ? "done" : null, "aria-current": place === at ? "step" : null },
          each,
          place < at ? el("span", { class: "visually-hidden" }, " (done)") : null,
        )),
    );
  }
  return {
    node,
    show(job) {
      const known = isSearch(job) || isDiagnosis(job);
      node.hidden = job.state !== "running" || !known;
      if (isEnded(job)) shown = null;
      if (node.hidden) return;
      showStages(job, getStages(job));
      setText(sentence, describePhase(job));
    },
  };
}
