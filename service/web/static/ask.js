// A question in a dialog: the browser's own element keeps the focus in it and Escape closes it.

import { h } from "./dom.js";
import { act } from "./states.js";

/**
 * ask({title, body?, fields: [{name, label, type?, hint?, value?, required?, options?}], after?, submit: "Publish",
 *      danger?, action: async (values) => ...}) shows a form; the action runs on submit, and its problem is shown in the dialog.
 * Answers what the action gave, or undefined when it was closed.
 */
export function ask({ title, body, fields = [], after, submit, danger = false, action }) {
  return new Promise((done) => {
    let result;
    const button = h("button", { type: "submit", class: danger ? "danger" : "primary" }, submit);
    const form = h(
      "form",
      { method: "dialog" },
      h("h2", {}, title),
      body,
      fields.map(field),
      after,
      h("div", { class: "actions" }, h("button", { type: "button", onclick: () => dialog.close() }, "Cancel"), button),
    );
    const dialog = h("dialog", { "aria-label": title, onclose: () => (dialog.remove(), done(result)) }, form);
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      // what is left empty is left out: the API knows no null
      const values = Object.fromEntries([...new FormData(form)].filter(([, value]) => value !== ""));
      await act(button, async () => {
        result = await action(values);
        dialog.close();
      });
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

function field({ name, label, type = "text", hint, value, required = true, options, ...more }) {
  const id = `ask-${name}`;
  const described = hint ? `${id}-hint` : null;
  const common = { id, name, required, "aria-describedby": described, ...more };
  const control = options
    ? h("select", common, options.map(([key, text]) => h("option", { value: key, selected: key === value }, text)))
    : type === "textarea"
      ? h("textarea", common, value)
      : h("input", { ...common, type, value });
  return h("p", { class: "field" }, h("label", { for: id }, label), control, hint ? h("span", { class: "hint", id: described }, hint) : null);
}
