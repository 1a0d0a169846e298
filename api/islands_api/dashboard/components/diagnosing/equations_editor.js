/** Editor of differential equations, which the service checks while they are written. */

import { postJson } from "../../lib/api.js";
import { el, setText } from "../../lib/dom.js";
import { writeToml } from "../../lib/toml.js";
import { makeField } from "../job_request.js";
import { makeParameterFields } from "./parameter_fields.js";

/** Milliseconds without a change before the text is checked. */
const PAUSE = 400;

/** Name of the file with the equations on the command line. */
const FILE = "equations.toml";

const HINT =
  "A TOML file: dNAME/dt = ... for a state, NAME = ... for a variable; [parameters] with value, unit and "
  + "limits. The states at the first sample are estimated.";

/** State that equations are valid, with their states and parameters. */
function describeSystem({ equations, parameters = {} }) {
  const states = [...equations.matchAll(/^\s*d\s*(\w+)\s*\/\s*dt/gm)].map(([, name]) => name);
  const names = Object.keys(parameters);
  return `Valid. States: ${states.join(", ") || "none"}. Parameters: ${names.join(", ") || "none"}.`;
}

/**
 * Make the editor. `templates` are listed simulations with equations, from which a text can start; `read()`
 * returns the checked simulation, or null. `onChange()` is called after a check.
 */
export function makeEquationsEditor(templates, onChange, signal) {
  const text = el("textarea", { name: "equations", rows: 18, spellcheck: "false", autocomplete: "off" });
  const start = el(
    "select",
    { name: "template" },
    templates.map(({ kind }) => el("option", { value: kind }, kind)),
  );
  const message = el("p", { class: "check", role: "status" });
  const parametersHost = el("div");
  let [checked, fields, timer, given] = [null, null, null, {}];

  function show(simulation, words) {
    checked = simulation;
    text.setAttribute("aria-invalid", String(simulation === null && words !== ""));
    message.classList.toggle("complaint", simulation === null && words !== "");
    setText(message, words);
    const parameters = Object.entries(simulation?.parameters ?? {}).filter(
      // A tolerance of the text counts, and a fixed value has none.
      ([, { tolerance, fixed }]) => tolerance === undefined && !fixed,
    );
    const described = parameters.map(([name, { value, unit = "" }]) => ({ name, unit, default: value }));
    fields = makeParameterFields(described, { hasValues: false, units: ["", ""] });
    fields.fill(given);
    parametersHost.replaceChildren(...(described.length ? [fields.node] : []));
    onChange();
  }

  async function check() {
    const asked = text.value;
    try {
      const simulation = await postJson("v1/simulations/equations", { text: asked });
      if (asked === text.value) show(simulation, describeSystem(simulation));
    } catch (error) {
      if (!signal.aborted && asked === text.value) show(null, error.message);
    }
  }

  function plan(pause) {
    checked = null;
    clearTimeout(timer);
    timer = setTimeout(check, pause);
    onChange();
  }

  function takeTemplate() {
    text.value = templates.find(({ kind }) => kind === start.value)?.equations ?? "";
    plan(0);
  }

  text.addEventListener("input", () => plan(PAUSE));
  start.addEventListener("change", takeTemplate);
  const node = el(
    "div",
    { class: "fields equations" },
    makeField("diagnose", "Start from", start, "Replaces the text by that of a built-in simulation."),
    makeField("diagnose", "Equations", text, HINT),
    el("span"),
    message,
    el("span"),
    el("span"),
    parametersHost,
    el("span"),
  );
  return {
    node,
    /** Write the simulation of a request as a text, with its tolerances. */
    fill({ simulation: { kind: _, ...system }, tolerance }) {
      given = { tolerance };
      text.value = writeToml(system);
      plan(0);
    },
    open: () => text.value || takeTemplate(),
    read: () =>
      checked && {
        simulation: checked,
        tolerance: fields.read().tolerance,
        argument: FILE,
        before: [`cat > ${FILE} <<'END'`, text.value.trimEnd(), "END"],
      },
  };
}
