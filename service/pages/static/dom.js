// Elements from values, and the regions of a page. Text is always text: nothing here reads HTML.

const NAMED = 0.06;

/** A budget as one bar, by share of the variance: rows are {source, share, said}, the largest first; the small ones are its thin end. */
export function budgetBar(rows) {
  const named = rows.filter(({ share }) => share >= NAMED);
  const rest = rows.slice(named.length);
  const parts = [...named, ...(rest.length ? [{ share: rest.reduce((sum, { share }) => sum + share, 0) }] : [])].map(({ source, share, said }) => {
    const part = h("span", source ? { title: `${source} ${said}` } : {}, source ? `${source} ${said}` : null);
    part.style.flexGrow = Math.max(share, 0.004);
    return part;
  });
  const bar = h("div", { class: "budget-bar", role: "img", "aria-label": named.map(({ source, share }) => `${source} ${Math.round(100 * share)} % of the variance`).join(", ") }, parts);
  return [bar, h("p", { class: "caption" }, `Width: share of the variance. In order: ${rows.map(({ source, said }) => `${source} ${said}`).join(", ")}.`)];
}

const AT_FIRST = 14;

export function shorten(rows, draw, count = AT_FIRST) {
  if (rows.length <= count + 4) return draw(rows);
  const place = h("div", {}, draw(rows.slice(0, count)));
  const more = h("button", { type: "button", class: "quiet" }, `Show all ${rows.length}`);
  more.addEventListener("click", () => (place.replaceChildren(draw(rows)), more.remove()));
  return [place, h("p", { class: "more" }, more)];
}

const steps = [];

/** Keep the way back of something that the page shows where it was done. */
export const remember = (undo) => steps.push(undo);

export function done(text, undo) {
  remember(undo);
  toast(text, { label: "Undo", key: "Z", action: () => take(undo) });
}

const LETTERS = "stilb-letter-keys";
export const lettersOn = () => localStorage.getItem(LETTERS) !== "off";
export const turnLetters = (on) => localStorage.setItem(LETTERS, on ? "on" : "off");

/** Whether a letter was typed that may be a command: in no field, and in no dialog but that of a frame. */
export const isCommand = (event) => lettersOn() && !event.ctrlKey && !event.metaKey && !event.altKey && !event.target.closest("input, select, textarea, dialog:not(.frame-sheet)");

addEventListener("keydown", (event) => event.key.toLowerCase() === "z" && isCommand(event) && steps.length && take(steps.at(-1)));

export async function take(undo) {
  const at = steps.indexOf(undo);
  if (at < 0) return;
  steps.splice(at, 1);
  try {
    await undo();
    toast("Undone.");
  } catch (error) {
    toast(`Not undone. ${error.message}`);
  }
}

/** mark("warn"), or mark("warn", "One frame to check") where no word beside it says so. */
export const mark = (kind, label) => svg("svg", { class: `v ${kind}`, ...(label ? { role: "img", "aria-label": label } : { "aria-hidden": "true" }) }, svg("use", { href: `#mark-${kind}` }));

export const OUTCOMES = { pass: ["good", "Passes"], warn: ["warn", "Check"], fail: ["bad", "Fails"], pending: ["wait", "Waiting"] };

/** A button that is pressed and released; `turn(isPressed)` hears of it. */
export const toggle = (text, turn, isPressed = false) => h("button", { type: "button", "aria-pressed": String(isPressed), onclick: ({ currentTarget: button }) => {
  button.ariaPressed = String(button.ariaPressed !== "true");
  turn(button.ariaPressed === "true");
} }, text);

/** Buttons of [value, text], of which one is pressed; `pick(value)` hears which. */
export function segments(label, options, chosen, pick) {
  const buttons = options.map(([value, text]) => h("button", { type: "button", "aria-pressed": String(value === chosen), onclick: ({ currentTarget }) => {
    for (const each of buttons) each.ariaPressed = String(each === currentTarget);
    pick(value);
  } }, text));
  return h("div", { class: "segments", role: "group", "aria-label": label }, buttons);
}

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
export const may = (scope) => (document.querySelector("meta[name=scopes]")?.content ?? "").split(" ").includes(scope);

/**
 * A table in its frame. Columns: {head, cell: row => node or text, class?}; the first may be {header: true}.
 * `kind`: its class. `stack`: on a phone each row becomes a card, for tables that are read row by row; others are moved sideways.
 */
export function table(columns, rows, { caption, row = () => ({}), stack = false, kind = "" } = {}) {
  const cell = (column, each) => {
    const content = column.cell(each);
    return h(column.header ? "th" : "td",
      {
        // said again, as a row that is laid out as a card would be no row any more
        role: column.header ? "rowheader" : "cell",
        scope: column.header ? "row" : null,
        class: column.class,
        "data-head": column.head || null,
      },
      // in a card, one part beside its head
      stack && Array.isArray(content) && present(content).length ? h("div", {}, content) : content,
    );
  };
  return h("div", { class: `table ${kind}`, tabindex: "0", role: "group", "aria-label": caption ?? "Table" },
    h("table", { role: "table", class: stack ? "stack" : null },
      caption ? h("caption", { class: "hidden" }, caption) : null,
      h("thead", { role: "rowgroup" },
        h("tr", { role: "row" }, columns.map((c) => (c.head ? h("th", { role: "columnheader", scope: "col", class: c.class }, c.head) : h("td", { role: "cell" })))),
      ),
      h("tbody", { role: "rowgroup" }, rows.map((each) => h("tr", { role: "row", ...row(each) }, columns.map((c) => cell(c, each))))),
    ),
  );
}

/** A figure of a list of them (a `dl`): its name, its value, and a note below it if there is one. */
export const figure = (name, value, note, attributes = {}) => h("div", {}, h("dt", {}, name), h("dd", attributes, value, note ? h("small", {}, note) : null));

/** The name of a file or a coefficient, which may be broken where its parts meet: most do not fit a phone. */
export const filename = (name) => name.split(/(?<=[_.-])/).flatMap((part) => [part, h("wbr")]);

let pressed = null;
addEventListener("pointerdown", (event) => (pressed = event.target), { capture: true });
for (const name of ["pointerup", "pointercancel", "dragend"]) addEventListener(name, () => (pressed = null), { capture: true });

/** Whether something in a place is pressed: replaced now, it would get no click. Unlike :active, this ends with a drag. */
export const isPressed = (place) => pressed !== null && place.contains(pressed);

/** Wait until nothing in a place is pressed: a field that is left by a press changes before the press ends. */
export async function released(place) {
  while (isPressed(place)) await new Promise(requestAnimationFrame);
}

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

const present = (children) => children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false);

/** Put rows behind an element, one after another; one that stays where it is keeps its focus. */
export function placeAfter(above, rows) {
  let place = above;
  for (const { element } of rows) {
    if (place.nextSibling !== element) place.after(element);
    place = element;
  }
}

const turns = new WeakMap();

/** Ask anew for what somebody holds. Answers whether that is still what was asked for last: what comes late is not shown over it. */
export function askLast(holder) {
  const turn = {};
  turns.set(holder, turn);
  return () => turns.get(holder) === turn;
}

/** The same for a region, which is busy meanwhile. */
export function begin(region) {
  region.setAttribute("aria-busy", "true");
  return askLast(region);
}

/** Load, then draw what `draw(value)` gives; on a problem say it, with a button to try again. */
export async function load(region, loader, draw) {
  const isLast = begin(region);
  try {
    const value = await loader();
    await released(region);
    if (!isLast()) return false;
    fill(region, draw(value));
    return true;
  } catch (error) {
    if (isLast()) fill(region, failed(error, () => load(region, loader, draw)));
    return false;
  } finally {
    if (isLast()) region.removeAttribute("aria-busy");
  }
}

export function empty(title, text, ...actions) {
  return h("div", { class: "empty" },
    h("p", { class: "empty-title" }, title),
    text ? h("p", {}, text) : null,
    actions.length ? h("p", { class: "actions" }, actions) : null,
  );
}

export function failed(error, again) {
  if (!error.code) console.error(error);
  return h("div", { class: "failed", role: "alert" },
    h("p", { class: "failed-title" }, error.title ?? "Error on this page"),
    h("p", {}, error.message),
    again && (error.retryable ?? true) ? h("p", {}, h("button", { type: "button", onclick: again }, "Try again")) : null,
  );
}

/** Run what a button or a form starts: once at a time, with its problem shown beside it. The button keeps the focus. */
export async function act(button, action) {
  if (button.ariaDisabled) return undefined;
  const scope = button.closest("form, dialog, .card, tr, section") ?? button.parentElement;
  scope.querySelectorAll(".act-failed").forEach((old) => old.remove());
  if (button.matches("button")) button.ariaDisabled = "true";
  button.ariaBusy = "true";
  try {
    return await action();
  } catch (error) {
    const said = failed(error);
    said.classList.add("act-failed");
    (button.closest(".actions, td, .reading-row") ?? button).after(said);
    // a long dialog has its buttons at its lower edge
    said.scrollIntoView({ block: "nearest" });
    return undefined;
  } finally {
    button.ariaDisabled = button.ariaBusy = null;
  }
}

/** An error that a person made, shown as one of the service's. */
export const wrong = (message) => Object.assign(new Error(message), { title: "Not sent", code: "typed", retryable: false });
