/** Name and status of a monitor, for the list of monitors and the page of a monitor. */

import { el, setText } from "../../lib/dom.js";

/** Return the name of a monitor, for an element `bdi`: some characters reverse the text that follows. */
export const getMonitorName = (monitor) => monitor.name || `Monitor ${monitor.id.slice(0, 8)}`;

/** Return the name of a monitor for a sentence, between characters that isolate its direction. */
export const getIsolatedMonitorName = (monitor) => `\u2068${getMonitorName(monitor)}\u2069`;

/** Make a badge with the status; `show(monitor)` updates it. */
export function makeStatusBadge() {
  const node = el("span", { class: "state" });
  return {
    node,
    show({ status }) {
      node.className = `state ${status}`;
      setText(node, status);
    },
  };
}
