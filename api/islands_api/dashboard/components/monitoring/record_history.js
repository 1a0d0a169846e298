/** Records of a monitor, loaded in pages as they are analysed. */

import { getJson } from "../../lib/api.js";

/** Number of latest records that are shown. A screen shows no more points. */
export const MAX_RECORDS = 2000;

/** Make the history of a monitor: `load(monitor)` adds the records that it has more. */
export function makeRecordHistory(path, signal) {
  const history = {
    /** Latest analysed and rejected records; `index` is the number of a record from 0. */
    analysed: [],
    rejected: [],

    async load({ records, result }) {
      if (result === null) return;
      await loadAfter("analysed", "", records - 1 - MAX_RECORDS);
      await loadAfter("rejected", "&rejected=true", -1);
    },
  };

  async function loadAfter(name, query, least) {
    for (;;) {
      const after = history[name].at(-1)?.index ?? Math.max(-1, least);
      const { items } = await getJson(`${path}/records?after=${after}${query}`, { signal });
      if (items.length === 0) return;
      history[name] = [...history[name], ...items].slice(-MAX_RECORDS);
    }
  }

  return history;
}
