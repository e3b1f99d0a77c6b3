// A question in a dialog: the browser's own element keeps the focus in it and Escape closes it.

import { about, field } from "./campaign/forms.js";
import { h, openDialog } from "./dom.js";
import { act } from "./states.js";

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
    const form = h(
      "form",
      { method: "dialog" },
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
    ? h("select", common, options.map(([key, text]) => h("option", { value: key, selected: key === value }, text)))
    : type === "textarea"
      ? h("textarea", common, value)
      : h("input", { ...common, type, value });
  return field(label, control, hint, of ? about(...[of, name].flat().slice(0, 2)) : help);
}
