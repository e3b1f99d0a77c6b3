// A region of a page: loading, filled, empty, or failed with the reason and what to do.

import { fill, h } from "./dom.js";

const turns = new WeakMap();

/** Begin to load a region anew. Answers whether that is still what was asked for last: what comes late is not shown over it. */
export function begin(region) {
  const turn = {};
  turns.set(region, turn);
  region.setAttribute("aria-busy", "true");
  return () => turns.get(region) === turn;
}

/** Load, then draw what `draw(value)` gives; on a problem say it, with a button to try again. */
export async function load(region, loader, draw) {
  const isLast = begin(region);
  try {
    const value = await loader();
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

export function loading(lines = 3) {
  return h(
    "div",
    { class: "loading", role: "status" },
    h("span", { class: "hidden" }, "Loading"),
    Array.from({ length: lines }, () => h("span", { class: "bone", "aria-hidden": "true" })),
  );
}

/** Nothing is there yet: say so, and what to do about it. */
export function empty(title, text, ...actions) {
  return h(
    "div",
    { class: "empty" },
    h("p", { class: "empty-title" }, title),
    text ? h("p", {}, text) : null,
    actions.length ? h("p", { class: "actions" }, actions) : null,
  );
}

/** What went wrong, in the service's own words. */
export function failed(error, again) {
  if (!error.code) console.error(error);
  return h(
    "div",
    { class: "failed", role: "alert" },
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
    (button.closest(".actions, td") ?? button).after(said);
    return undefined;
  } finally {
    button.ariaDisabled = button.ariaBusy = null;
  }
}

/** An error that a person made, shown as one of the service's. */
export const wrong = (message) => Object.assign(new Error(message), { title: "Not sent", code: "typed", retryable: false });
