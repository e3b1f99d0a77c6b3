// Fields of the campaign's forms.

import { h } from "../dom.js";

let count = 0;

/** field("Columns", h("input"), "hint"): with its label and its hint. */
export function field(label, control, hint) {
  control.id ||= `field-${(count += 1)}`;
  if (hint) control.setAttribute("aria-describedby", `${control.id}-hint`);
  return h("p", { class: "field" }, h("label", { for: control.id }, label), control, hint ? h("span", { class: "hint", id: `${control.id}-hint` }, hint) : null);
}

export const select = (options, attributes = {}, chosen = undefined) =>
  h("select", attributes, options.map(([value, text]) => h("option", { value, selected: value === chosen }, text)));

export const decimal = (attributes = {}) => h("input", { inputmode: "decimal", autocomplete: "off", ...attributes });

/** A group of exclusive choices with a sentence each; none is taken for granted where `chosen` is none of them. */
export function choices(name, options, onchange, chosen = options[0][0]) {
  return options.map(([value, title, text]) =>
    h(
      "label",
      { class: "choice" },
      h("input", { type: "radio", name, value, required: true, checked: value === chosen, onchange: () => onchange(value) }),
      h("span", {}, h("strong", {}, title), text ? h("span", { class: "hint" }, text) : null),
    ),
  );
}

/** What is filled in of a form's fields, by name. */
export const filled = (form) =>
  Object.fromEntries([...new FormData(form)].filter(([, value]) => typeof value === "string" && value.trim() !== "").map(([name, value]) => [name, value.trim()]));
