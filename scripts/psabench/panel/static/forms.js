// Forms made from the rows of the command table: what may be entered is what the table says.

import { make, options } from "./page.js";

const quoted = (text) => (/[\s"'#]/.test(text) ? `"${text.replace(/(["\\])/g, "\\$1")}"` : text);

export function input(arg, prefix) {
  const hint = [arg.what, arg.unit].filter(Boolean).join(", ");
  const common = { name: arg.name, "aria-label": `${prefix} ${arg.name}`, title: hint, required: !arg.optional };
  if (arg.kind === "bool") return select(common, ["on", "off"], arg.optional);
  if (arg.choices.length && arg.strict) return select(common, arg.choices, arg.optional);
  const number = arg.kind === "real" || arg.kind === "count";
  const more = number ? { type: "number", step: arg.kind === "count" ? 1 : "any", min: arg.low, max: arg.high } : { type: "text" };
  const box = make("input", { ...common, ...more, placeholder: arg.optional ? "-" : arg.unit });
  box.style.width = number ? "8em" : "11em";
  return box;
}

function select(common, choices, optional) {
  const box = make("select", common);
  options(box, optional ? ["", ...choices] : choices);
  return box;
}

export function lineOf(name, args, form) {
  const words = [name];
  for (const arg of args) {
    const value = form.elements[arg.name] ? form.elements[arg.name].value.trim() : "";
    if (value === "") continue;
    words.push(arg.kind === "rest" ? value : `${arg.name}=${quoted(value)}`);
  }
  return words.join(" ");
}

export function commandForm(name, command, say) {
  const form = make("form", { class: "form", "data-command": name, title: command.what });
  for (const arg of command.args) form.append(make("label", {}, labelled(arg), input(arg, name)));
  form.append(make("button", {}, name.split(".").at(-1)));
  form.addEventListener("submit", (event) => { event.preventDefault(); say(lineOf(name, command.args, form)); });
  return form;
}

export const labelled = (arg) => `${arg.name}${arg.unit && !arg.name.includes("_") ? `, ${arg.unit}` : ""} `;
