/** Form that starts an identification of a data set, with the same request for other programs. */

import { el } from "../lib/dom.js";
import { makeField, makeJobForm, quote } from "./job_request.js";
import { makeSearchSettings } from "./search_settings.js";

const SAMPLING_TIME = "In seconds; only for a record that does not contain it.";

const ABSENT = "Choose at least one input and the output in the table of columns.";

/** Return a setting on the command line. */
const makeSetting = ([name, value]) => ["--set", quote(`${name}=${[value].flat().join(",")}`)];

/** Return the options of the command line; null if it cannot state the request. */
function listOptions(request, reading) {
  const { dataset, inputs, output, rows, validation, preset, dt, seed, model, recordings } = request;
  const isForeign = typeof validation === "object" && validation.dataset !== dataset;
  // Further recordings are data sets, and the command line uploads files.
  if (recordings?.length || isForeign) return null;
  const held = typeof validation === "object" ? validation.rows : validation;
  return [
    ...inputs.flatMap((each) => ["--input", quote(each)]),
    ...[output].flat().flatMap((each) => ["--output", quote(each)]),
    ...(dt ? ["--dt", String(dt)] : []),
    ...(rows ? ["--rows", rows] : []),
    ...(held === undefined ? [] : ["--validation", String(held)]),
    ...(preset === "auto" ? [] : ["--preset", preset]),
    ...(model && model !== "narx" ? ["--model", model] : []),
    ...(seed ? ["--seed", String(seed)] : []),
    ...Object.entries({ ...reading, ...request.settings }).flatMap(makeSetting),
  ];
}

const list = (names) => names.join(", ");

/** Make the statement of the other recordings of the same request, each with a link. */
const makeRecordings = (recordings) =>
  recordings.length > 0 &&
  el(
    "p",
    {},
    "Together with ",
    recordings.flatMap(({ dataset, name }, at) => [
      at ? ", " : "",
      el("a", { href: `#/data/${dataset}` }, el("bdi", {}, name ?? dataset)),
    ]),
    ". The end of each recording validates, unless a range is marked.",
  );

/**
 * Make the form of a data set. `initial` has fields of a request that are set; `ranges` has the rows of the
 * request. `show({inputs, output})` and `setSamplingTime(dt)` update it.
 */
export function makeRunForm({ id, name, preview }, initial, ranges, signal) {
  const dt = el("input", { name: "dt", type: "number", step: "any", min: 0, placeholder: "from the record" });
  dt.value = initial.dt ?? "";
  const search = makeSearchSettings(initial, () => form.update(), signal);
  const hasChanges = Boolean(initial.settings) || (initial.preset ?? "auto") !== "auto";
  const settings = el(
    "details",
    { open: hasChanges },
    el("summary", {}, "Settings"),
    search.nodes[0],
    el("div", { class: "fields" }, makeField("run", "Sampling time", dt, SAMPLING_TIME)),
    search.nodes[1],
  );
  let choice = { inputs: [], output: "" };

  const hasColumns = () => choice.inputs.length > 0 && choice.output !== "";

  function getRequest() {
    const { model, seed, recordings = [] } = initial;
    return {
      dataset: id,
      inputs: choice.inputs,
      output: choice.output,
      ...search.getRequest(),
      name: initial.name ?? name,
      ...ranges.getRequest(),
      ...(dt.value && { dt: Number(dt.value) }),
      ...(recordings.length && { recordings: recordings.map(({ name: _, ...part }) => part) }),
      ...(model && { model }),
      ...(seed && { seed }),
    };
  }

  const form = makeJobForm({
    action: "Identify",
    path: "v1/jobs",
    makeRequest: () => (hasColumns() && ranges.isComplete() ? getRequest() : null),
    describe: (request) => ({
      ...{ call: "submit", command: "submit" },
      options: listOptions(request, preview.reading),
    }),
    explain: () => (hasColumns() ? [choice.inputs, [choice.output].flat()].map(list).join(" → ") : ABSENT),
    fields: (row) => [row, makeRecordings(initial.recordings ?? []), settings].filter(Boolean),
  });
  return {
    node: el("section", { class: "card" }, el("h2", {}, "Identify a model"), form.node),
    update: form.update,
    show(newChoice) {
      choice = newChoice;
      form.update();
    },
    setSamplingTime(seconds) {
      dt.value = seconds;
      settings.open = true;
      dt.focus();
      form.update();
    },
    getRequest,
  };
}
