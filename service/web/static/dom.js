// Elements from values. Text is always text: nothing here reads HTML.

/** h("td", {class: "number", onclick: f, hidden: false}, "text", element, [more], null) */
export function h(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...present(children));
  return element;
}

/** Put these children in place of what an element holds. */
export function fill(element, ...children) {
  element.replaceChildren(...present(children));
  return element;
}

export const byId = (id) => document.getElementById(id);

/** Whether the key that is signed in with has a scope: what it may not do is not offered. */
export const may = (scope) =>
  (document.querySelector("meta[name=scopes]")?.content ?? "").split(" ").includes(scope);

/** A table in its frame. Columns: {head, cell: row => node or text, class?}; the first may be {header: true}. */
export function table(columns, rows, { caption, row = () => ({}) } = {}) {
  return h(
    "div",
    { class: "table", tabindex: "0", role: "region", "aria-label": caption ?? "Table" },
    h(
      "table",
      {},
      caption ? h("caption", { class: "hidden" }, caption) : null,
      h("thead", {}, h("tr", {}, columns.map((c) => h("th", { scope: "col", class: c.class }, c.head)))),
      h(
        "tbody",
        {},
        rows.map((each) =>
          h(
            "tr",
            row(each),
            columns.map((c) =>
              h(c.header ? "th" : "td", { scope: c.header ? "row" : null, class: c.class }, c.cell(each)),
            ),
          ),
        ),
      ),
    ),
  );
}

/** Say something in passing, also to a screen reader. */
export function toast(text) {
  const shown = h("div", { class: "toast" }, text);
  byId("toasts").append(shown);
  setTimeout(() => shown.remove(), 6000);
}

function present(children) {
  return children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false);
}
