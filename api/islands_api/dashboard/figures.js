/** Figures of the service: asked for when they come into sight, one after the other, shown as pictures. */

import { blob } from "./api.js";
import { el } from "./dom.js";

const TITLES = {
  "free-run": "Free run",
  loop: "Hysteresis loop",
  hold: "Held input",
  residuals: "Residual correlations",
  record: "The record",
  front: "Error against number of terms",
  convergence: "Convergence",
  islands: "Islands",
};

/** How far below the screen a figure is asked for, in pixels. */
const AHEAD = "150px";

// The first figure of a model has all of them drawn: to ask for the others meanwhile only takes connections.
let last = Promise.resolve();

function queued(what) {
  const mine = last.then(what);
  last = mine.catch(() => {});
  return mine;
}

/** Show a figure that lies at a path. */
export function figure(path, name, signal) {
  const title = TITLES[name] ?? name;
  const save = el("a", { class: "small", hidden: true, download: `${name}.svg` }, "SVG");
  const paper = el("div", { class: "paper" });
  const node = el("figure", { class: "drawn" }, el("figcaption", {}, el("h4", {}, title), save), paper);

  async function draw() {
    paper.replaceChildren(el("p", { class: "drawing", role: "status" }, "Being drawn…"));
    try {
      const picture = await queued(() => blob(`${path}/${name}.svg`, { signal }));
      const address = URL.createObjectURL(picture);
      signal.addEventListener("abort", () => URL.revokeObjectURL(address), { once: true });
      save.href = address;
      save.hidden = false;
      paper.replaceChildren(el("img", { src: address, alt: `${title}, drawn by the service` }));
    } catch (error) {
      if (signal.aborted) return;
      const again = el("button", { type: "button", on: { click: draw } }, "Try again");
      paper.replaceChildren(el("p", { class: "complaint" }, error.message), again);
    }
  }

  const observer = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    draw();
  }, { rootMargin: AHEAD });
  observer.observe(node);
  signal.addEventListener("abort", () => observer.disconnect(), { once: true });
  return node;
}
