/** Records that were added at once: a link to each, and the offer to use them in one job. */

import { getDatasetPath, getJson } from "../lib/api.js";
import { el } from "../lib/dom.js";
import { formatCount, formatShort } from "../lib/numbers.js";

/** Records of one job, at most: as many as the service accepts. */
const MOST_RECORDINGS = 64;

const listColumns = ({ preview }) => preview.columns.map(({ name }) => name).join("\n");

function describe({ preview }) {
  const step = preview.dt === null ? "unknown sampling time" : `${formatShort(preview.dt)} s`;
  return ` ${formatCount(preview.samples)} rows, ${step}`;
}

function makeOffer([first, ...others]) {
  if (!others.length) return null;
  if (others.some((each) => listColumns(each) !== listColumns(first)))
    return el("p", { class: "soft" }, "Their columns differ, so that each of them needs its own job.");
  if (others.length >= MOST_RECORDINGS) return null;
  const together = new URLSearchParams({ together: others.map(({ id }) => id).join(",") });
  return el(
    "p",
    { class: "row" },
    el("a", { class: "button", href: `#/data/${first.id}?${together}` }, "Use them together in one job"),
    el("span", { class: "soft small" }, "as recordings of the same system"),
  );
}

/** Make the card of data sets that were added at once. */
export async function makeAddedCard(ids, signal) {
  const records = await Promise.all(
    ids.map((id) => getJson(getDatasetPath(id), { signal })),
  );
  const items = records.map((record) =>
    el(
      "li",
      {},
      el("a", { href: `#/data/${record.id}` }, el("bdi", {}, record.name)),
      el("span", { class: "soft small" }, describe(record)),
    ),
  );
  return el(
    "section",
    { class: "card", "aria-label": "Added records" },
    el("h2", {}, `${records.length} ${records.length === 1 ? "record" : "records"} added`),
    el("ul", {}, items),
    makeOffer(records),
  );
}
