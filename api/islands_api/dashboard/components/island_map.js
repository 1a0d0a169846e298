/** Map of the islands of a search: their best errors, and the ways of models at the last migration. */

import { el, setText, svg } from "../lib/dom.js";
import { formatNumber } from "../lib/numbers.js";
import { COLOURS } from "./chart.js";

/** Height of the map, and the room at each side for the errors of islands. */
const [SIZE, SIDE] = [250, 45];

/** Part of the radius from the vertical axis within which the error is above or below its island. */
const MIDDLE = 0.2;

/** Radii of the circle of islands and of an island, and the room of an arrow head, in pixels. */
const [RING, NODE, HEAD] = [88, 15, 8];

function place(island, islands) {
  const angle = (2 * Math.PI * island) / islands - Math.PI / 2;
  return [SIZE / 2 + RING * Math.cos(angle), SIZE / 2 + RING * Math.sin(angle)];
}

/** Make the text for the error of an island, outside of the circle of islands, where no arrow is. */
function makeErrorText(x, y) {
  const [right, down] = [(x - SIZE / 2) / RING, y > SIZE / 2 ? 1 : -1];
  if (Math.abs(right) < MIDDLE) {
    const outwards = down > 0 ? NODE + 13 : -NODE - 5;
    return svg("text", { class: "tick middle", x, y: y + outwards });
  }
  const outwards = Math.sign(right) * (NODE + 5);
  return svg("text", { class: right < 0 ? "tick end" : "tick", x: x + outwards, y: y + 4 + 4 * down });
}

/** Make an arrow between two islands, bent so that both directions are visible. */
function makeArrow(from, to, islands) {
  const [[x1, y1], [x2, y2]] = [place(from, islands), place(to, islands)];
  const length = Math.hypot(x2 - x1, y2 - y1);
  const [ux, uy] = [(x2 - x1) / length, (y2 - y1) / length];
  const bend = Math.min(14, length / 6);
  const [mx, my] = [(x1 + x2) / 2 - uy * bend, (y1 + y2) / 2 + ux * bend];
  // The tangents at both ends point from and to the control point.
  const [start, end] = [
    [x1, y1, NODE + 1],
    [x2, y2, NODE + HEAD],
  ].map(([x, y, gap]) => {
    const reach = Math.hypot(mx - x, my - y);
    return [x + ((mx - x) / reach) * gap, y + ((my - y) / reach) * gap];
  });
  const d = `M${start.map((each) => each.toFixed(1))}Q${mx.toFixed(1)} ${my.toFixed(1)} `
    + end.map((each) => each.toFixed(1)).join(" ");
  return svg("path", { class: "way", d, "marker-end": "url(#arrow)" });
}

const makeMarker = () =>
  svg(
    "defs",
    {},
    svg(
      "marker",
      { id: "arrow", viewBox: "0 0 8 8", refX: 1, refY: 4, markerWidth: 7, markerHeight: 7, orient: "auto" },
      svg("path", { class: "head", d: "M0 0L8 4L0 8Z" }),
    ),
  );

/** List the ways in words: `island 2 from 1, 4; island 3 from 2`. */
const describeWays = (sources) =>
  sources
    .map((each, to) =>
      each.length ? `island ${to + 1} from ${each.map((from) => from + 1).join(", ")}` : "")
    .filter(Boolean)
    .join("; ");

/** Make the map; `show(progress, unit)` updates it. It is hidden before the first migration. */
export function makeIslandMap(unit) {
  const drawing = svg("svg", { viewBox: `${-SIDE} 0 ${SIZE + 2 * SIDE} ${SIZE}`, role: "img" });
  const caption = el("p", { class: "soft small" });
  const node = el(
    "figure",
    { class: "map", hidden: true },
    el("figcaption", {}, el("h3", {}, "Last migration")),
    drawing,
    caption,
  );
  let [drawn, texts] = ["", []];

  function draw(sources) {
    const islands = sources.length;
    const ways = sources.flatMap((each, to) => each.map((from) => makeArrow(from, to, islands)));
    const places = sources.map((_, island) => place(island, islands));
    texts = places.map(([x, y]) => makeErrorText(x, y));
    const nodes = places.flatMap(([x, y], island) => [
      svg("circle", { class: `island s${island % COLOURS}`, cx: x, cy: y, r: NODE }),
      svg("text", { class: "tick middle number", x, y: y + 4 }, String(island + 1)),
      texts[island],
    ]);
    drawing.replaceChildren(makeMarker(), ...ways, ...nodes);
    drawing.setAttribute("aria-label", `Islands that received models: ${describeWays(sources)}`);
  }

  return {
    node,
    show({ islands = [], migration } = {}) {
      node.hidden = !migration || migration.sources.length !== islands.length;
      if (node.hidden) return;
      const { generation, emigrants, sources } = migration;
      if (drawn !== JSON.stringify(sources)) draw(sources);
      drawn = JSON.stringify(sources);
      islands.forEach((error, island) => setText(texts[island], formatNumber(error)));
      const sent = emigrants === 1 ? "1 model was sent" : `up to ${emigrants} models were sent`;
      const scale = unit ? `, in ${unit}` : "";
      setText(
        caption,
        `Generation ${generation}: ${sent} along each arrow. Numbers are least errors of islands${scale}.`,
      );
    },
  };
}
