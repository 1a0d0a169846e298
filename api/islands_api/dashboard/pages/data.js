/** Page with the list of data sets, newest first, and the button to add some. */

import { makeAddedCard } from "../components/added_records.js";
import { showProblem } from "../components/banner.js";
import { makeFileButton } from "../components/file_upload.js";
import { makePagedTable } from "../components/paged_table.js";
import { describeReading } from "../components/record_notes.js";
import { getJson } from "../lib/api.js";
import { makeAge } from "../lib/clock.js";
import { el } from "../lib/dom.js";
import { NONE, formatBytes, formatCount, formatShort } from "../lib/numbers.js";
import { poll } from "../lib/polling.js";

/** Number of data sets on a page, and seconds between two requests. */
const [PAGE_SIZE, POLL_SECONDS] = [25, 4];

const makeAddress = (cursor) => (cursor ? `#/data?${new URLSearchParams({ cursor })}` : "#/data");

/** Make the link to a data set; the same file may be read in several ways. */
const makeName = ({ id, name, reading = {} }) => [
  el("a", { href: `#/data/${id}` }, el("bdi", {}, name)),
  Object.keys(reading).length > 0 && el("span", { class: "soft small" }, describeReading(reading)),
];

function makeRow(dataset) {
  const number = (name, text) =>
    el("td", { class: text === NONE ? "figure none" : "figure", "data-label": name }, text);
  const node = el(
    "tr",
    {},
    el("th", { scope: "row" }, makeName(dataset)),
    number("columns", formatCount(dataset.columns)),
    number("rows", formatCount(dataset.samples)),
    number("sampling time", dataset.dt === null ? NONE : `${formatShort(dataset.dt)} s`),
    number("size", formatBytes(dataset.bytes)),
    number("warnings", dataset.warnings ? String(dataset.warnings) : NONE),
    el("td", { class: "figure" }, makeAge(dataset.created)),
  );
  // A data set does not change.
  return { node, show: () => {} };
}

/** Make the invitation to add the first record. */
const makeInvitation = () =>
  el(
    "section",
    { class: "card invitation" },
    el("h2", {}, "Drop a record here"),
    el(
      "p",
      {},
      "A table with an input and an output: CSV and other text, Excel, MATLAB, HDF5, Parquet, NPZ, MDF ",
      "or TDMS.",
    ),
    makeFileButton(),
  );

/** Show the list in a host until the signal aborts. */
export function mountData(host, { cursor = "", added = "" }, signal) {
  document.title = "Data · islands";
  const table = makePagedTable({
    caption: "Data sets, newest first",
    headings: [
      "Data set",
      ...["Columns", "Rows", "Sampling time", "Size", "Warnings", "Added"].map((name) => [name, "figure"]),
    ],
    makeRow,
    makeEmptyMessage: () => (cursor ? el("p", { class: "empty" }, "No older data sets.") : makeInvitation()),
    makeAddress,
    cursor,
  });
  const recent = el("div");
  host.replaceChildren(
    el("div", { class: "heading" }, el("h1", { tabindex: "-1" }, "Data"), makeFileButton()),
    recent,
    ...table.nodes,
  );
  if (added)
    makeAddedCard(added.split(","), signal).then(
      (card) => recent.replaceChildren(card),
      (error) => signal.aborted || showProblem(error),
    );
  poll(async () => {
    const query = new URLSearchParams({ limit: PAGE_SIZE, ...(cursor && { cursor }) });
    const page = await getJson(`v1/datasets?${query}`, { signal });
    if (!signal.aborted) table.show(page);
    return POLL_SECONDS;
  }, signal);
  return {};
}
