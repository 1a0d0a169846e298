/** Causes that a diagnosis has screened: score, confidence, and equivalent causes. */

import { el, makeFacts, makeScrollable, makeTable, svg } from "../../lib/dom.js";
import { formatNumber } from "../../lib/numbers.js";

/** Number of causes that are shown at first, besides the named ones. */
const SHOWN = 10;

/** Make a bar whose length is a share of the largest score. */
function makeBar(score, most) {
  const width = Math.max(0, (100 * score) / most);
  const bar = svg("rect", { width, height: 10, rx: 1 });
  return svg(
    "svg",
    { class: "bar", viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true" },
    bar,
  );
}

/** Format a confidence as the sentences do: no cause is certain. */
function formatConfidence(value) {
  if (value >= 0.995) return "above 0.99";
  return value < 0.005 ? "below 0.01" : value.toFixed(2);
}

/** Write the plain name of a cause, then that of the program, which earlier versions have alone. */
function makeName(name, place, titles) {
  const title = titles[place ? `${name}:${place}` : name];
  return title ? [`${title} `, el("code", {}, name)] : [name];
}

/** Return whether an effect is a named cause; earlier versions have no others. */
const isNamed = (effect) => effect !== undefined && effect.claimed !== false;

function makeRow({ name, place, score, eta }, effect, most, hasEffects, titles) {
  return [
    el("span", { class: isNamed(effect) ? "named" : null }, ...makeName(name, place, titles)),
    el("span", { class: "score" }, makeBar(score, most), formatNumber(score)),
    `${Math.floor(100 * eta)} %`,
    // No cause that passed all tests: both columns would be empty.
    ...(hasEffects
      ? [effect ? formatConfidence(effect.confidence) : "", effect?.equivalents.join(", ") ?? ""]
      : []),
  ];
}

function makeCauseTable(candidates, effects, most, titles) {
  const headings = [
    ...["Cause", "Score", ["Explained", "figure"]],
    ...(effects.length ? [["Confidence", "figure"], "Equivalent causes"] : []),
  ];
  const findEffect = (cause) => effects.find(({ name }) => name === cause);
  const hasEffects = effects.length > 0;
  const rows = candidates.map((each) => makeRow(each, findEffect(each.name), most, hasEffects, titles));
  const table = makeTable("Screened causes, the best first", headings, rows);
  table.classList.add("causes");
  return makeScrollable("Screened causes", table);
}

/** Make the section of the causes of a result. */
export function makeCauses({ candidates, effects, titles = {}, ...others }) {
  const { decisive_experiment: words, next_experiment: next } = others;
  if (!candidates.length) return null;
  const most = Math.max(...candidates.map(({ score }) => score), 1e-9);
  const make = (part) => makeCauseTable(part, effects, most, titles);
  const isShown = ({ name }, place) =>
    place < SHOWN || isNamed(effects.find((effect) => effect.name === name));
  const rest = candidates.filter((each, place) => !isShown(each, place));
  // Results of earlier versions have the experiment in words alone.
  const isUnsure = next === undefined && effects.some(({ equivalents }) => equivalents.length);
  const about =
    "Each effect alone is added to the calibrated simulation. The score is the decrease of −2 log-likelihood "
    + "after a penalty on the parameters; only causes that passed all tests have a confidence.";
  return el(
    "section",
    { class: "card" },
    el("h2", {}, "Causes"),
    el("p", { class: "soft small" }, about),
    make(candidates.filter(isShown)),
    rest.length > 0 &&
      el("details", { class: "rest" }, el("summary", {}, `${rest.length} further causes`), make(rest)),
    isUnsure && makeFacts([["Experiment that separates them", words ?? "none was found"]]),
  );
}
