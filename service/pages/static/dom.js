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

/** svg("path", {class: "mark", d: "M0 0h1"}, child): the same for a drawing. */
export function svg(tag, attributes = {}, ...children) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** Put these children in place of what an element holds. What is alike takes the focus of what had it, else the element does. */
export function fill(element, ...children) {
  const held = document.activeElement;
  const holds = held !== element && element.contains(held);
  element.replaceChildren(...present(children));
  if (holds && document.activeElement !== held) {
    const same = [...element.querySelectorAll(STOPS)].filter((each) => nameOf(held) && nameOf(each) === nameOf(held));
    focusOn(same.find((each) => each.localName === held.localName) ?? same[0] ?? element);
  }
  return element;
}

const STOPS = "a, button, input, select, textarea, summary, [tabindex]";

/** By which a control is known again: data-keep where neither label nor text stay the same. */
const nameOf = (control) => control.dataset.keep || control.getAttribute("aria-label") || control.name || control.textContent;

function focusOn(place) {
  if (!place.matches(STOPS)) place.tabIndex = -1;
  place.focus({ preventScroll: true });
}

/** Show a dialog over all else until it is closed; then the focus is where it was, or as near to it as there is anything left. */
export function openDialog(dialog) {
  const before = [];
  for (let each = document.activeElement; each && each !== document.body; each = each.parentElement) before.push(each);
  dialog.addEventListener("close", () => {
    dialog.remove();
    const left = before.find((each) => each.isConnected);
    if (left && document.activeElement === document.body) focusOn(left);
  });
  document.body.append(dialog);
  dialog.showModal();
}

/** Go to another page, or load this one again. This never ends: the button that led there stays busy until the page is gone. */
export function leave(address) {
  if (address) location.assign(address);
  else location.reload();
  // and where the browser kept this page for the way back, it begins again
  addEventListener("pageshow", (event) => event.persisted && location.reload());
  return new Promise(() => {});
}

/** A sentence as nodes: what stands between backticks is a name. */
export const prose = (text) => (text ?? "").split("`").map((part, place) => (place % 2 ? h("code", {}, part) : part));

export const byId = (id) => document.getElementById(id);

/** Whether the key that is signed in with has a scope: what it may not do is not offered. */
export const may = (scope) =>
  (document.querySelector("meta[name=scopes]")?.content ?? "").split(" ").includes(scope);

/**
 * A table in its frame. Columns: {head, cell: row => node or text, class?}; the first may be {header: true}.
 * `stack`: on a phone each row becomes a card, for tables that are read row by row; others are moved sideways.
 */
export function table(columns, rows, { caption, row = () => ({}), stack = false } = {}) {
  const cell = (column, each) =>
    h(
      column.header ? "th" : "td",
      {
        // said again, as a row that is laid out as a card would be no row any more
        role: column.header ? "rowheader" : "cell",
        scope: column.header ? "row" : null,
        class: column.class,
        "data-head": column.head || null,
      },
      column.cell(each),
    );
  return h(
    "div",
    { class: "table", tabindex: "0", role: "group", "aria-label": caption ?? "Table" },
    h(
      "table",
      { role: "table", class: stack ? "stack" : null },
      caption ? h("caption", { class: "hidden" }, caption) : null,
      h(
        "thead",
        { role: "rowgroup" },
        h("tr", { role: "row" }, columns.map((c) => (c.head ? h("th", { role: "columnheader", scope: "col", class: c.class }, c.head) : h("td", { role: "cell" })))),
      ),
      h("tbody", { role: "rowgroup" }, rows.map((each) => h("tr", { role: "row", ...row(each) }, columns.map((c) => cell(c, each))))),
    ),
  );
}

/** A figure of a list of them (a `dl`): its name, its value, and a note below it if there is one. */
export function figure(name, value, note, attributes = {}) {
  return h("div", {}, h("dt", {}, name), h("dd", attributes, value, note ? h("small", {}, note) : null));
}

/** The name of a file or a coefficient, which may be broken where its parts meet: most do not fit a phone. */
export const filename = (name) => name.split(/(?<=[_.-])/).flatMap((part) => [part, h("wbr")]);

let pressed = null;
addEventListener("pointerdown", (event) => (pressed = event.target), { capture: true });
for (const name of ["pointerup", "pointercancel", "dragend"]) addEventListener(name, () => (pressed = null), { capture: true });

/** Whether something in a place is pressed: replaced now, it would get no click. Unlike :active, this ends with a drag. */
export const isPressed = (place) => pressed !== null && place.contains(pressed);

let toasts;

/** A modal dialog covers all else, and nothing outside it can be reached: what passes by stands in it. */
function place() {
  const dialog = [...document.querySelectorAll("dialog[open]")].at(-1);
  (dialog ?? document.body).append(toasts);
  dialog?.addEventListener("close", place, { once: true });
}

/** Say something in passing, also to a screen reader; `offer` is a button {label, key, action} beside it. */
export function toast(text, offer) {
  const shown = h("div", { class: "toast" }, text, offer ? h("button", { type: "button", onclick: () => (shown.remove(), offer.action()) }, offer.label, " ", h("kbd", {}, offer.key)) : null);
  toasts ??= byId("toasts");
  place();
  toasts.append(shown);
  setTimeout(() => shown.remove(), offer ? 12000 : 6000);
}

function present(children) {
  return children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false);
}
