// Fields of the campaign's forms.

import { h } from "../dom.js";

let count = 0;

/** The place of a field in the manual, behind a question mark; in a tab of its own, as a form is not to be lost. */
export const manualLink = (address, label) => h("a", { class: "help", href: address, target: "_blank" }, h("span", { "aria-hidden": "true" }, "?"), h("span", { class: "hidden" }, `${label} in the manual, in a new tab`));

/** field("Columns", h("input"), "hint"): with its label and its hint; `help` is its place in the manual. */
export function field(label, control, hint, help) {
  control.id ||= `field-${(count += 1)}`;
  if (hint) control.setAttribute("aria-describedby", `${control.id}-hint`);
  return h("p", { class: "field" }, help ? h("span", { class: "label-row" }, h("label", { for: control.id }, label), manualLink(help, label)) : h("label", { for: control.id }, label), control, hint ? h("span", { class: "hint", id: `${control.id}-hint` }, hint) : null);
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
