/** Charts of a monitor over its records: parameters with intervals, scores of effects, noise, statistic. */

import { el } from "../../lib/dom.js";
import { makeLineChart } from "../chart.js";

/** Number of further effects whose scores are drawn at most, as in `monitor.svg`. */
const MAX_EFFECTS = 3;

/** Return the number of a record and its time or name for texts; records are numbered from 1. */
export const describePlace = ({ index, name, time }) =>
  [`record ${index + 1}`, time ? time.slice(0, 16).replace("T", " ") : name].join(", ");

/** Return the effects that are drawn: those that alarms name, then those with the largest recent scores. */
export function chooseEffects({ effects, alarms, training }, records) {
  const named = alarms.map(({ cause }) => cause).filter((cause) => effects.includes(cause));
  const recent = records.slice(-training);
  const size = (effect) => Math.abs(recent.reduce((sum, { scores }) => sum + scores[effect], 0));
  const largest = [...effects].sort((a, b) => size(b) - size(a));
  return [...new Set([...named, ...largest])].slice(0, MAX_EFFECTS);
}

/**
 * Return the bands and lines of a chart: trainings, and for each alarm its interval, beginning and record.
 * The training begins again at the first changed record. Those before the first point are left out.
 */
export function makeEvents({ alarms, training }, records) {
  const [first, last] = [records[0].index + 1, records.at(-1).index + 1];
  const starts = [0, ...alarms.map(({ since }) => since.index)];
  const trainings = starts.map((start, at) => ({
    kind: "training",
    from: start + 1,
    to: Math.min(start + training, starts[at + 1] ?? last),
  }));
  const events = [
    ...trainings,
    ...alarms.flatMap(({ record, since, since_ci95: [earliest, latest] }) => [
      { kind: "since-band", from: earliest.index + 1, to: latest.index + 1 },
      { kind: "since", at: since.index + 1 },
      { kind: "alarm", at: record.index + 1 },
    ]),
  ];
  return events
    .filter(({ at, to = at }) => to >= first)
    .map((event) => ("from" in event ? { ...event, from: Math.max(event.from, first) } : event));
}

/** Return `[{title, label, series}]`, one for each chart. */
export function makeStateSeries(result, records) {
  const x = records.map(({ index }) => index + 1);
  const follow = (name, select) => ({ name, x, y: records.map(select) });
  const parameters = result.parameters.map(({ name, unit }) => ({
    title: name,
    label: unit ? `${name} / ${unit}` : name,
    series: [
      {
        ...follow(name, ({ values }) => values[name].value),
        half: records.map(({ values }) => (values[name].ci95[1] - values[name].ci95[0]) / 2),
      },
    ],
  }));
  const effects = chooseEffects(result, records);
  return [
    ...parameters,
    {
      title: "Scores of further effects",
      label: "score / sigma",
      series: effects.map((effect) => follow(effect, ({ scores }) => scores[effect])),
    },
    { title: "Noise", label: "standard deviation", series: [follow("noise", ({ noise }) => noise)] },
    {
      title: "Test statistic",
      label: "statistic / sigma",
      series: [
        follow("statistic", ({ statistic }) => statistic),
        { ...follow("limit", ({ statistic }) => (statistic === null ? null : result.threshold)), bare: true },
      ],
    },
  ];
}

const explain = (kind, text) =>
  el("li", {}, el("span", { class: `key-mark ${kind}`, "aria-hidden": "true" }), text);

/** Make the panel; `show(result, records)` draws the records. */
export function makeStatesPanel(signal) {
  const charts = new Map();
  const host = el("div", { class: "states" });
  const key = el(
    "ul",
    { class: "event-key soft small", "aria-label": "Marks in the charts" },
    explain("training", "training"),
    explain("since-band", "95 % interval of the first changed record"),
    explain("since", "its estimate"),
    explain("alarm", "alarm"),
  );
  let known = [];

  function makeChart({ title, label }) {
    const describe = (at) => describePlace(known[at - 1 - known[0].index]);
    const x = { label: "record", integer: true, describe };
    return makeLineChart({ title, x, y: { label }, marks: true }, signal);
  }

  return {
    node: el("section", { class: "card", hidden: true }, el("h2", {}, "States"), key, host),
    show(result, records) {
      known = records;
      this.node.hidden = records.length === 0;
      if (records.length === 0) return;
      const events = makeEvents(result, records);
      for (const each of makeStateSeries(result, records)) {
        if (!charts.has(each.title)) {
          charts.set(each.title, makeChart(each));
          host.append(charts.get(each.title).node);
        }
        charts.get(each.title).draw(each.series, events);
      }
    },
  };
}
