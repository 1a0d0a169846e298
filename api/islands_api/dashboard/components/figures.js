/** Figures drawn by the service, loaded one at a time when they scroll into view. */

import { getBlob } from "../lib/api.js";
import { el } from "../lib/dom.js";
import { makeFileLinks } from "./figure_files.js";

const TITLES = {
  "free-run": "Free run",
  "static-curve": "Output over the inputs",
  structure: "Structure",
  curves: "Curves of the units",
  bode: "Frequency response",
  nyquist: "Nyquist plot",
  "pole-map": "Poles and zeros",
  "unit-step": "Response to a unit step",
  loop: "Output over input",
  hold: "Held input",
  residuals: "Residual correlations",
  record: "Record",
  front: "Error against size",
  convergence: "Convergence",
  islands: "Islands",
};

/** Figures without lines of numbers. */
const DIAGRAMS = new Set(["structure"]);

/** Distance below the viewport at which a figure is loaded. */
const PRELOAD_MARGIN = "150px";

// The first request for a figure of a model draws all of them: parallel requests would only use connections.
let lastTask = Promise.resolve();

function enqueue(task) {
  const result = lastTask.then(task);
  lastTask = result.catch(() => {});
  return result;
}

/** Make the figure at a path, with the query of its address. */
export function makeFigure(path, name, signal, query = "") {
  const title = TITLES[name] ?? name.replace(/^free-run-(\d)$/, "Free run of output $1");
  const files = el("span", { class: "files", hidden: true });
  const paper = el("div", { class: "paper" });
  const node = el("figure", { class: "rendered" }, el("figcaption", {}, el("h4", {}, title), files), paper);

  async function load() {
    paper.replaceChildren(el("p", { class: "drawing", role: "status" }, "Drawing…"));
    try {
      const image = await enqueue(() => getBlob(`${path}/${name}.svg${query}`, { signal }));
      const url = URL.createObjectURL(image);
      signal.addEventListener("abort", () => URL.revokeObjectURL(url), { once: true });
      const picture = el("img", { src: url, alt: `${title}, drawn by the service` });
      const table = DIAGRAMS.has(name) ? null : `${path}/${name}.csv${query}`;
      files.replaceChildren(...makeFileLinks(table, name, title, picture));
      files.hidden = false;
      paper.replaceChildren(picture);
    } catch (error) {
      if (signal.aborted) return;
      const retry = el("button", { type: "button", on: { click: load } }, "Try again");
      paper.replaceChildren(el("p", { class: "complaint" }, error.message), retry);
    }
  }

  const observer = new IntersectionObserver((entries) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    load();
  }, { rootMargin: PRELOAD_MARGIN });
  observer.observe(node);
  signal.addEventListener("abort", () => observer.disconnect(), { once: true });
  return node;
}
