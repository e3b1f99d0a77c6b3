// The keys of the grid. Letters can be switched off, for those whose speech or switch types them by accident.

import { h, openDialog } from "../dom.js";

const KEPT = "stilb-letter-keys";
const KEYS = [
  ["Arrows, Page Up, Page Down", "walk the grid"],
  ["Home, End", "ends of a row; with Ctrl, of the grid"],
  ["Enter", "open a frame; in a reading: record it and go to the next scene without one"],
  ["Space, Shift + arrows", "select frames"],
  ["M", "move to a scene"],
  ["X", "leave out, or use again"],
  ["R", "go to the reading of the row"],
  ["Z", "undo"],
  ["← →", "in a frame: previous, next"],
  ["N", "in a frame: next to check"],
  ["Esc", "close; from a reading back to the grid"],
];

export const lettersOn = () => localStorage.getItem(KEPT) !== "off";

export function showKeys() {
  const dialog = h(
    "dialog",
    { "aria-labelledby": "keys" },
    h("h2", { id: "keys" }, "Keys"),
    h("dl", { class: "facts" }, KEYS.map(([key, does]) => [h("dt", {}, h("kbd", {}, key)), h("dd", {}, does)])),
    h("label", { class: "check" }, h("input", { type: "checkbox", checked: lettersOn(), onchange: (event) => localStorage.setItem(KEPT, event.target.checked ? "on" : "off") }), "Letter keys"),
    h("p", { class: "actions" }, h("button", { type: "button", onclick: () => dialog.close() }, "Close")),
  );
  openDialog(dialog);
}
