/** Links that save a figure as SVG, as PNG and as CSV. */

import { download, saveBlob } from "../lib/api.js";
import { el, runOnceAtATime } from "../lib/dom.js";
import { showProblem } from "./banner.js";

/** Pixels per CSS pixel of a saved PNG: 300 per inch of a figure 7 inches wide. */
const PNG_SCALE = 300 / 96;

/** Make the links of a loaded picture; `table` is the address of its numbers, null for a diagram. */
export function makeFileLinks(table, name, title, picture) {
  const link = (text, attributes) => {
    const file = `${name}.${text.toLowerCase()}`;
    return el("a", { "aria-label": `${title} as ${text}`, download: file, ...attributes }, text);
  };
  const intercept = (save) => {
    const run = runOnceAtATime(() => save().catch(showProblem));
    return (event) => {
      event.preventDefault();
      run(event);
    };
  };
  return [
    link("SVG", { href: picture.src }),
    link("PNG", { href: picture.src, on: { click: intercept(() => savePng(picture, `${name}.png`)) } }),
    ...(table
      ? [link("CSV", { href: table, on: { click: intercept(() => download(table, `${name}.csv`)) } })]
      : []),
  ];
}

/** Save a picture as PNG: on white, as in print. */
async function savePng(picture, name) {
  await picture.decode();
  const canvas = el("canvas", {
    width: Math.round(PNG_SCALE * picture.naturalWidth),
    height: Math.round(PNG_SCALE * picture.naturalHeight),
  });
  const context = canvas.getContext("2d");
  context.drawImage(picture, 0, 0, canvas.width, canvas.height);
  saveBlob(await new Promise((resolve) => canvas.toBlob(resolve, "image/png")), name);
}
