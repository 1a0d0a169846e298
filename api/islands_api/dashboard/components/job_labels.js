/** Labels of a job: its name, which is changed in place, and its tags, which are links to the list. */

import { getJobPath, sendJson } from "../lib/api.js";
import { announce, el } from "../lib/dom.js";
import { clearBanner, showProblem } from "./banner.js";
import { makeJobsAddress } from "./job_filters.js";

/** Change the name or the tags of a job; return the changed job, or null after a problem. */
async function label(job, changes) {
  clearBanner("problem");
  try {
    return await sendJson("PATCH", getJobPath(job.id), changes);
  } catch (error) {
    showProblem(error);
    return null;
  }
}

/** Make a form with one field that takes the place of an element until it is submitted or left. */
function openField(place, { name, value, maxlength }, { save, close }) {
  const field = el("input", { "aria-label": name, value, maxlength, autocomplete: "off" });
  const form = el("form", { class: "in-place" }, field);
  let isOpen = true;
  function leave() {
    if (!isOpen) return;
    isOpen = false;
    form.remove();
    close();
  }
  async function submit(event) {
    event.preventDefault();
    if (!isOpen || (await save(field.value.trim(), field))) leave();
  }
  form.addEventListener("submit", submit);
  field.addEventListener("keydown", (event) => event.key === "Escape" && leave());
  field.addEventListener("blur", () => isOpen && form.requestSubmit());
  place.after(form);
  field.focus();
  field.select();
}

/**
 * Make the button that changes the name of a job. The field takes the place of `display` meanwhile.
 * `getJob()` returns the job, and `changed(job)` takes the changed one.
 */
export function makeRenameButton(display, { getJob, changed }) {
  const button = el("button", { type: "button", class: "quiet icon" }, "✎");
  function close() {
    const hadFocus = document.activeElement === document.body;
    display.hidden = button.hidden = false;
    if (hadFocus) button.focus({ preventScroll: true });
  }
  async function save(name) {
    if (name === getJob().name) return true;
    const job = await label(getJob(), { name });
    if (job === null) return false;
    changed(job);
    announce("The name is changed.");
    return true;
  }
  button.addEventListener("click", () => {
    display.hidden = button.hidden = true;
    openField(display, { name: "Name of the job", value: getJob().name, maxlength: 200 }, { save, close });
  });
  return {
    node: button,
    show: (name) => button.setAttribute("aria-label", `Rename ${name}`),
  };
}

const makeTagLink = (tag) => el("a", { class: "tag", href: makeJobsAddress({ tag }) }, el("bdi", {}, tag));

/** Make the tags of a job in a list; `show(job)` updates them. */
export function makeTags() {
  const node = el("span", { class: "tags" });
  let shown = "";
  return {
    node,
    show({ tags = [] }) {
      if (shown === tags.join()) return;
      shown = tags.join();
      node.replaceChildren(...tags.map(makeTagLink));
    },
  };
}

/** Make the tags of a job with buttons that remove and add some; `changed(job)` takes the changed job. */
export function makeTagEditor({ changed }) {
  const list = el("span", { class: "tags" });
  const add = el("button", { type: "button", class: "quiet small" }, "+ Tag");
  let [job, shown] = [null, null];

  async function setTags(tags, text) {
    const answer = await label(job, { tags });
    if (answer === null) return false;
    changed(answer);
    announce(text);
    return true;
  }
  const remove = (tag) => async () => {
    if (await setTags(job.tags.filter((each) => each !== tag), `The tag ${tag} is removed.`)) add.focus();
  };
  const makeEntry = (tag) =>
    el(
      "span",
      { class: "entry" },
      makeTagLink(tag),
      el(
        "button",
        {
          ...{ type: "button", class: "quiet icon", "aria-label": `Remove the tag ${tag}` },
          on: { click: remove(tag) },
        },
        "×",
      ),
    );
  const save = async (tag) =>
    !tag || job.tags.includes(tag) || setTags([...job.tags, tag], `The tag ${tag} is added.`);
  function close() {
    const hadFocus = document.activeElement === document.body;
    add.hidden = false;
    if (hadFocus) add.focus({ preventScroll: true });
  }
  add.addEventListener("click", () => {
    add.hidden = true;
    openField(add, { name: "New tag", value: "", maxlength: 40 }, { save, close });
  });

  return {
    node: el("div", { class: "tags row", role: "group", "aria-label": "Tags" }, list, add),
    show(newJob) {
      job = { tags: [], ...newJob };
      if (shown === job.tags.join()) return;
      shown = job.tags.join();
      list.replaceChildren(...job.tags.map(makeEntry));
    },
  };
}
