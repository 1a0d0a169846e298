/** Upload of records: files that are dropped anywhere on a page, or chosen with a button. */

import { getJson } from "../lib/api.js";
import { announce, el } from "../lib/dom.js";
import { clearBanner, showNotice, showProblem } from "./banner.js";

/** Upload a file; return its data set. */
export function uploadFile(file) {
  const body = new FormData();
  body.append("file", file);
  return getJson("v1/datasets", { method: "POST", body });
}

/** Upload files one after the other. The page of a single one opens, and for several the list with these. */
async function uploadFiles(files) {
  clearBanner("problem");
  const [stored, refused] = [[], []];
  for (const file of files) {
    showNotice(`Reading ${file.name}…`);
    try {
      stored.push(await uploadFile(file));
    } catch (error) {
      refused.push(error);
    }
  }
  clearBanner("notice");
  announce(`${stored.length} of ${files.length} files can be used`);
  const messages = refused.map(({ message }) => message);
  if (refused.length) showProblem({ ...refused[0], message: messages.join("\n") });
  const added = stored.map(({ id }) => id).join(",");
  if (stored.length)
    location.hash = files.length === 1 ? `#/data/${added}` : `#/data?${new URLSearchParams({ added })}`;
}

/** Make a button that opens the dialog for files. */
export function makeFileButton() {
  const field = el("input", { type: "file", multiple: true, hidden: true, "aria-label": "Records" });
  field.addEventListener("change", async () => {
    await uploadFiles([...field.files]);
    field.value = "";
  });
  const click = () => field.click();
  const button = el("button", { type: "button", class: "strong", on: { click } }, "Choose files");
  return el("span", {}, button, field);
}

const hasFiles = ({ dataTransfer }) => dataTransfer?.types.includes("Files");

/** Return whether a field takes a dropped file itself. */
const isField = ({ target }) => target.matches?.("input[type=file]");

/** Upload files that are dropped anywhere on the page. */
export function listenForDroppedFiles() {
  const mark = (isOver) => document.body.classList.toggle("dropping", isOver);
  addEventListener("dragover", (event) => {
    if (!hasFiles(event) || isField(event)) return;
    event.preventDefault();
    mark(true);
  });
  addEventListener("dragleave", ({ relatedTarget }) => relatedTarget === null && mark(false));
  addEventListener("drop", (event) => {
    mark(false);
    if (!hasFiles(event) || isField(event)) return;
    event.preventDefault();
    uploadFiles([...event.dataTransfer.files]);
  });
}
