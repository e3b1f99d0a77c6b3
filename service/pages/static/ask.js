// Fields of forms, and a question in a dialog: the browser's own element keeps the focus in it and Escape closes it.

import { act, h, openDialog, prose, wrong } from "./dom.js";
import { FIELDS } from "./fields.js";
import { inOrder } from "./format.js";

/**
 * ask({title, body?, fields: [{name, label, type?, hint?, of?, help?, value?, required?, options?}], after?, submit: "Publish",
 *      danger?, action: async (values) => ...}) shows a form; the action runs on submit, and its problem is shown in the dialog.
 * `of`: the API's form, or [form, name of the field in it], whose sentence about the field opens behind a question mark;
 * `help`: another sentence, or a place in the manual.
 * Answers what the action gave, or undefined when it was closed.
 */
export function ask({ title, body, fields = [], after, submit, danger = false, action }) {
  return new Promise((done) => {
    let result;
    const button = h("button", { type: "submit", class: danger ? "danger" : "primary" }, submit);
    const form = h("form", { method: "dialog" },
      h("h2", {}, title),
      body,
      fields.map((each, at) => ofField({ autofocus: at === 0, ...each })),
      after,
      h("div", { class: "actions" }, h("button", { type: "button", onclick: () => dialog.close() }, "Cancel"), button),
    );
    const dialog = h("dialog", { "aria-label": title, onclose: () => done(result) }, form);
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      // what is left empty is left out: the API knows no null
      const values = Object.fromEntries([...new FormData(form)].filter(([, value]) => value !== ""));
      await act(button, async () => {
        result = await action(values);
        dialog.close();
      });
    });
    openDialog(dialog);
  });
}

function ofField({ name, label, type = "text", hint, of, help, value, required = true, options, ...more }) {
  const common = { id: `ask-${name}`, name, required, ...more };
  const control = options
    ? select(options, common, value)
    : type === "textarea"
      ? h("textarea", common, value)
      : h("input", { ...common, type, value });
  return field(label, control, hint, of ? about(...[of, name].flat().slice(0, 2)) : help);
}

let count = 0;

/** The place of a field in the manual, behind a question mark; in a tab of its own, as a form is not to be lost. */
export const manualLink = (address, label) => h("a", { class: "help", href: address, target: "_blank" }, h("span", { "aria-hidden": "true" }, "?"), h("span", { class: "hidden" }, `${label} in the manual, in a new tab`));

/** What the API says of a field of one of its forms: about("NewCamera", "serial"). */
export function about(form, name) {
  const text = FIELDS[form]?.[name];
  if (!text) throw new Error(`nothing is said of ${name} of ${form}`);
  return text;
}

/**
 * field("Columns", h("input"), "hint", "/docs/geometry#the-target"): with its label and its hint. `help` opens behind a
 * question mark: its place in the manual, or the sentence about it, which a screen reader has without opening it.
 */
export function field(label, control, hint, help) {
  if (!help) throw new Error(`nothing is said of ${label}`);
  control.id ||= `field-${(count += 1)}`;
  const parts = { hint: hint && h("span", { class: "hint", id: `${control.id}-hint` }, hint), about: !help.startsWith("/") && h("span", { class: "hint about", id: `${control.id}-about`, hidden: true }, prose(help)) };
  const described = Object.values(parts).filter(Boolean).map((part) => part.id);
  if (described.length) control.setAttribute("aria-describedby", described.join(" "));
  const named = h("label", { for: control.id }, label);
  const asked = parts.about ? aboutButton(named.textContent, parts.about) : manualLink(help, named.textContent);
  return h("p", { class: "field" }, h("span", { class: "label-row" }, named, asked), parts.about, control, parts.hint);
}

export function boxes(heading, help, ...ticked) {
  const text = h("p", { class: "hint about", id: `field-${(count += 1)}-about`, hidden: true }, prose(help));
  return h("fieldset", {}, h("legend", {}, h("span", { class: "label-row" }, heading, aboutButton(heading, text))), text, ticked);
}

function aboutButton(label, text) {
  const button = h("button", { type: "button", class: "help", "aria-expanded": "false", "aria-controls": text.id, onclick: () => button.setAttribute("aria-expanded", String(!(text.hidden = !text.hidden))) }, h("span", { "aria-hidden": "true" }, "?"), h("span", { class: "hidden" }, `About ${label}`));
  return button;
}

export const optionsOf = (options, chosen) => options.map(([value, text]) => h("option", { value, selected: value === chosen }, text));

export const select = (options, attributes = {}, chosen = undefined) => h("select", attributes, optionsOf(options, chosen));

const ANOTHER = "another";

/** A list of what is registered, after `none` of it; its last choice asks by `register()` for another. */
export function registry(items, { nameOf, register, none, ...attributes }, chosen = "") {
  const known = new Map(items.map((each) => [each.id, each]));
  const offer = (id) => list.replaceChildren(...optionsOf([["", none], ...inOrder([...known.values()], nameOf).map((each) => [each.id, nameOf(each)]), [ANOTHER, "Register another…"]], id));
  const list = h("select", { ...attributes, onchange: async () => {
    if (list.value !== ANOTHER) return;
    const made = await register();
    if (made) known.set(made.id, made);
    offer(made?.id ?? "");
  } });
  offer(chosen);
  return list;
}

export const decimal = (attributes = {}) => h("input", { inputmode: "decimal", autocomplete: "off", ...attributes });

/** A group of exclusive choices with a sentence each; none is taken for granted where `chosen` is none of them. */
export function choices(name, options, onchange, chosen = options[0][0]) {
  return options.map(([value, title, text]) => h("label", { class: "choice" },
    h("input", { type: "radio", name, value, required: true, checked: value === chosen, onchange: () => onchange(value) }),
    h("span", {}, h("strong", {}, title), text ? h("span", { class: "hint" }, text) : null),
  ));
}

export const filled = (form) =>
  Object.fromEntries([...new FormData(form)].filter(([, value]) => typeof value === "string" && value.trim() !== "").map(([name, value]) => [name, value.trim()]));

const APART = /^[+-]?\d{1,3}([\s’']\d{3})+(?=[.,]|$)/;

/** A number with a decimal point or comma, thousands apart by blanks; NaN for anything else, "1,234.5" too: nobody can tell what that is. */
export function readNumber(text) {
  const plain = text.trim().replace("−", "-").replace(APART, (whole) => whole.replace(/[\s’']/g, ""));
  return /^[+-]?(\d+([.,]\d*)?|[.,]\d+)(e[+-]?\d+)?$/i.test(plain) ? Number(plain.replace(",", ".")) : NaN;
}

/** The number of a field, or undefined when it is empty; what is none is told in the field's own words. */
export function numberOf(input, { integer = false } = {}) {
  const text = input.value.trim();
  input.removeAttribute("aria-invalid");
  if (text === "") return undefined;
  const value = readNumber(text);
  if (Number.isFinite(value) && !(integer && !Number.isInteger(value))) return value;
  input.setAttribute("aria-invalid", "true");
  input.focus();
  const label = input.labels?.[0]?.textContent ?? "This";
  throw wrong(`${label}: “${text}” is not ${integer ? "a whole number" : "a number"}.`);
}
