/** Form that uploads records by hand and adds them to a monitor, in the order of their names. */

import { postJson } from "../../lib/api.js";
import { announce, el } from "../../lib/dom.js";
import { clearBanner, showProblem } from "../banner.js";
import { uploadFile } from "../file_upload.js";

const inNumericOrder = new Intl.Collator("en", { numeric: true }).compare;

async function addRecord(path, file) {
  const { id } = await uploadFile(file);
  await postJson(`${path}/records`, { dataset: id, name: file.name });
}

/** Make the form; `onAdded()` is called after each record. */
export function makeRecordUpload(path, onAdded) {
  const field = el("input", { id: "record-files", type: "file", multiple: true, required: true });
  const submit = el("button", { type: "submit" }, "Add to the monitor");

  async function send(event) {
    event.preventDefault();
    clearBanner("problem");
    submit.disabled = true;
    const files = [...field.files].sort((a, b) => inNumericOrder(a.name, b.name));
    let added = 0;
    try {
      for (const file of files) {
        await addRecord(path, file);
        added += 1;
        onAdded();
      }
      field.value = "";
    } catch (error) {
      showProblem(error);
    }
    announce(`${added} of ${files.length} records submitted`);
    submit.disabled = false;
  }

  return el(
    "form",
    { class: "card upload row", on: { submit: send } },
    el("label", { for: "record-files" }, "Next records"),
    field,
    submit,
  );
}
