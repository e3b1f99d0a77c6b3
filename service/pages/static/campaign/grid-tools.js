// Above the grid: which frames are shown, how many are selected and what is done to them, and how typed readings were read.

import { all } from "../api.js";
import { OUTCOMES, act, byId, fill, h, lettersOn, mark, may, openDialog, turnLetters } from "../dom.js";
import { number } from "../format.js";
import { readingTools } from "./book.js";
import { askExposure, askWhere, leaveOut, withdraw } from "./moves.js";
import { askForMeter } from "./target.js";

/** `chosen` are the ids; `after` is called when something was done. */
function bulkForm(state, chosen, after) {
  const button = (text, work, attributes = {}) => h("button", { type: "button", ...attributes, onclick: (event) => act(event.target, async () => (await work(state, [...chosen]), after())) }, text);
  return [
    h("strong", { class: "bulk-count" }),
    h("span", { class: "actions" }, button("Move…", askWhere, { class: "primary" }), button("Exposure…", askExposure), button("Leave out", leaveOut), button("Withdraw", withdraw, { class: "danger" }), h("button", { type: "button", class: "quiet", onclick: after }, "Clear selection")),
  ];
}

/** The buttons of the outcomes, the search and the tools; `view`, {outcome, text}, is what was chosen, `draw()` draws it. */
export function toolsOf({ state, book, view, reads, draw, selectAll, paste }) {
  const outcomes = h("div", { class: "segments", role: "group", "aria-label": "Which frames" });
  function drawCounts() {
    const count = (outcome) => state.frames.filter((frame) => (outcome === "out" ? frame.left_out !== null : frame.left_out === null && frame.outcome === outcome)).length;
    const options = [["", "All", null, state.frames.length], ...Object.entries(OUTCOMES).map(([outcome, [kind, said]]) => [outcome, said, kind, count(outcome)]), ["out", "Left out", "out", count("out")], ["gap", "Gaps", "gap", state.gaps.length]];
    fill(outcomes, options.filter(([name, , , of]) => name === "" || of || view.outcome === name).map(([name, said, kind, of]) =>
      h("button", { type: "button", "aria-pressed": String(view.outcome === name), "data-keep": `outcome ${name}`, onclick: () => ((view.outcome = name), draw()) }, kind ? mark(kind) : null, " ", said, " ", h("small", {}, number(of, 6)))));
  }

  const register = async () => {
    const made = await askForMeter();
    if (!made) return;
    book.meter_id = made.id;
    book.meet([...book.meters, made]);
  };
  if (reads) Promise.all([book.refresh(), all("/v1/meters").then((meters) => book.meet(meters))]);
  const element = h("div", { class: "grid-tools" },
    outcomes,
    h("input", { type: "search", "aria-label": "Find a frame", placeholder: "Name, role or scene", value: view.text, oninput: (event) => ((view.text = event.target.value.trim()), draw()) }),
    may("calibrate") ? h("button", { type: "button", class: "quiet small-button", onclick: selectAll }, "Select all") : null,
    h("button", { type: "button", class: "quiet small-button", "aria-label": "Keys", onclick: showKeys }, h("kbd", {}, "?")),
    reads && may("calibrate") ? readingTools(book, register, paste) : null,
  );
  return { element, outcomes, drawCounts };
}

/** What is done to the `chosen` frames; `clear()` selects none, `rest()` takes the focus. */
export function bulkOf({ state, chosen, clear, rest }) {
  const bulk = h("div", { class: "bulk card", hidden: true });
  function drawBulk() {
    const held = bulk.contains(document.activeElement);
    for (const id of chosen) if (!state.byId.has(id)) chosen.delete(id);
    bulk.hidden = chosen.size === 0;
    if (chosen.size && !bulk.firstChild) fill(bulk, bulkForm(state, chosen, clear));
    if (!chosen.size) {
      fill(bulk);
      if (held) rest();
    } else bulk.querySelector(".bulk-count").textContent = `${number(chosen.size, 6)} selected`;
  }
  return { element: bulk, drawBulk };
}

export function showKeys() {
  const dialog = byId("keys").content.firstElementChild.cloneNode(true);
  const box = dialog.querySelector("input");
  box.checked = lettersOn();
  box.addEventListener("change", () => turnLetters(box.checked));
  openDialog(dialog);
}
