/** Words about a job: its kind, its verdict, and what distinguishes it from similar jobs. */

/** Kinds of jobs in words. */
export const KINDS = {
  identification: "Identification",
  discrepancy: "Diagnosis",
  monitoring: "Record of a monitor",
};

/** Return whether a job is a discrepancy diagnosis. */
export const isDiagnosis = (job) => job.kind === "discrepancy";

/** Return whether a job identifies models. */
export const isSearch = (job) => job.kind === "identification";

/** Format the verdict of a job, `named: thermal-drift`, or the status of its monitor. */
export const formatVerdict = ({ verdict: word, effects = [], status }) =>
  effects.length ? `${word}: ${effects.join(", ")}` : (word ?? status);

/** Largest number of settings that a row lists. */
const MAX_SETTINGS = 4;

/** Return what a job has found: the equation of its recommended model, or the causes of a discrepancy. */
export const getFinding = ({ summary }) =>
  summary?.equation?.replaceAll("\n", "; ") ?? summary?.effects?.join(", ") ?? "";

/** Return the verdict of a job in words; empty if it has none. */
export function getVerdict({ summary, ...job }) {
  if (!summary) return "";
  if (!isSearch(job)) {
    const [first] = (summary.words ?? "").split("\n");
    return first.replaceAll("`", "") || formatVerdict(summary);
  }
  const [, verdict = ""] = /^As a simulation: ([^(\n]+)/m.exec(summary.words ?? "") ?? [];
  return verdict.trim().replace(/\.$/, "");
}

function listSettings({ settings = {}, preset = "auto", model = "narx", seed = 0, rows, simulation }) {
  const chosen = Object.entries(settings ?? {}).map(([name, value]) => `${name} ${value}`);
  return [
    simulation?.kind,
    model === "narx" ? null : model,
    preset === "auto" ? null : preset,
    rows && `rows ${rows}`,
    seed ? `seed ${seed}` : null,
    ...chosen.slice(0, MAX_SETTINGS),
    chosen.length > MAX_SETTINGS ? "…" : null,
  ].filter(Boolean);
}

/**
 * Describe a job by its owner if it is shown, its kind, its data set unless it is called like it, its
 * settings and its columns.
 */
export function describeJob({ owner, kind, name, dataset_name: dataset, spec }, showsOwner = false) {
  const inputs = [spec.inputs ?? spec.input ?? []].flat();
  const outputs = [spec.output ?? []].flat();
  const columns = inputs.length ? `${inputs.join(", ")} → ${outputs.join(", ")}` : null;
  const about = [showsOwner && owner, KINDS[kind] ?? kind, dataset === name ? null : dataset];
  const parts = [...about, ...listSettings(spec), columns];
  return parts.filter(Boolean).join(" · ");
}
