/** Tables of the alarms, of the analysed records and of the rejected records of a monitor. */

import { formatUtc } from "../../lib/clock.js";
import { el, makeScrollable, makeTable } from "../../lib/dom.js";
import { NONE, formatInterval, formatNumber } from "../../lib/numbers.js";

/** Number of rows that are shown at first, and added by each click. */
const STEP = 25;

const makeName = (name) => el("bdi", {}, name);

/** Format the time of a record, which has the time zone of the machine unless it states one. */
const formatTime = (time) => (/(Z|[+-]\d\d:?\d\d)$/.test(time) ? formatUtc(time) : time.replace("T", " "));

function describeOrigin({ record, since }) {
  const time = record.time ? `, ${formatTime(record.time)}` : "";
  const raised = `Raised by record ${record.index + 1} (\u2068${record.name}\u2069${time})`;
  return `${raised}. The first changed record is number ${since.index + 1}.`;
}

/** Make the panel of the alarms, latest first. */
export function makeAlarmsPanel() {
  const host = el("div", { class: "findings" });
  const makeAlarm = (alarm) =>
    el(
      "div",
      { class: "alarm-entry" },
      el("p", { class: "verdict" }, alarm.words),
      el("p", { class: "soft" }, describeOrigin(alarm)),
    );
  return {
    node: el("section", { class: "card failure", hidden: true }, el("h2", {}, "Alarms"), host),
    show({ alarms }) {
      this.node.hidden = alarms.length === 0;
      host.replaceChildren(...alarms.map(makeAlarm).reverse());
    },
  };
}

function makeRecordRow(result, record, hasTimes) {
  const isAlarm = result.alarms.some((alarm) => alarm.record.index === record.index);
  const statistic = formatNumber(record.statistic);
  return [
    String(record.index + 1),
    makeName(record.name),
    ...(hasTimes ? [record.time ? formatTime(record.time) : NONE] : []),
    ...result.parameters.map(({ name }) => {
      const { value, ci95 } = record.values[name];
      return formatInterval(value, (ci95[1] - ci95[0]) / 2);
    }),
    formatNumber(record.noise),
    isAlarm ? el("span", { class: "state alarm" }, statistic) : statistic,
  ];
}

/** Make the panel of the records, latest first, and of those that could not be analysed. */
export function makeRecordsPanel() {
  let [result, records, shown] = [null, [], STEP];
  const host = el("div");
  const rejectedHost = el("div");
  const click = () => {
    shown += STEP;
    render();
  };
  const more = el("button", { type: "button", on: { click } }, "Show older records");

  function render() {
    const last = records.slice(-shown);
    const hasTimes = last.some(({ time }) => time);
    const headings = [
      ...["Record", "Name", ...(hasTimes ? ["Time"] : [])],
      ...result.parameters.map(({ name, unit }) => [unit ? `${name} / ${unit}` : name, "figure"]),
      ...["Noise", "Statistic"].map((name) => [name, "figure"]),
    ];
    const latest = last.map((record) => makeRecordRow(result, record, hasTimes)).reverse();
    host.replaceChildren(makeScrollable("Records", makeTable("Records, latest first", headings, latest)));
    more.hidden = shown >= records.length;
  }

  function renderRejected(rejected) {
    const rows = rejected.map(({ name, reason }) => [makeName(name), reason]).reverse();
    const title = "Rejected records";
    const table = makeScrollable(title, makeTable(title, ["Name", "Reason"], rows));
    rejectedHost.replaceChildren(...(rows.length ? [el("h3", {}, "Rejected"), table] : []));
  }

  return {
    node: el(
      "section",
      { class: "card records", hidden: true },
      el("h2", {}, "Records"),
      host,
      more,
      rejectedHost,
    ),
    show(newResult, { analysed, rejected }) {
      [result, records] = [newResult, analysed];
      this.node.hidden = false;
      render();
      renderRejected(rejected);
    },
  };
}
