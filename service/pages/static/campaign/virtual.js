// A table of any length: only visible rows exist. All rows have the same height.

import { fill, h } from "../dom.js";

const MARGIN = 6;

/**
 * columns: [{head, class?}]; draw(item) gives the cells' contents; keyOf(item) names it; markOf(item) changes when
 * the row must be redrawn. Answers {element, show(items)}.
 */
export function virtualTable({ columns, rowHeight, caption, draw, keyOf, markOf, classOf = () => null }) {
  const above = h("tr", { "aria-hidden": "true" }, h("td", { class: "gap" }));
  const below = h("tr", { "aria-hidden": "true" }, h("td", { class: "gap" }));
  const body = h("tbody", {}, above, below);
  const grid = h(
    "table",
    {},
    h("caption", { class: "hidden" }, caption),
    h("thead", {}, h("tr", { "aria-rowindex": "1" }, columns.map((c) => h("th", { scope: "col", class: c.class }, c.head)))),
    body,
  );
  const element = h("div", { class: "table virtual", tabindex: "0", role: "region", "aria-label": caption }, grid);
  let items = [];
  let drawn = new Map();
  let waiting = false;
  let walked;

  function update() {
    waiting = false;
    const seen = element.clientHeight || 600;
    const from = Math.max(0, Math.floor(element.scrollTop / rowHeight) - MARGIN);
    const to = Math.min(items.length, Math.ceil((element.scrollTop + seen) / rowHeight) + MARGIN);
    const next = new Map();
    for (let index = from; index < to; index += 1) next.set(keyOf(items[index]), rowOf(items[index], index));
    let left;
    for (const [key, row] of drawn) {
      if (next.has(key)) continue;
      if (row.element.contains(document.activeElement)) left = row.element.rowIndex;
      row.element.remove();
    }
    let place = above;
    for (const row of next.values()) {
      // moved only where it must be: a row that stays keeps its focus
      if (place.nextSibling !== row.element) place.after(row.element);
      place = row.element;
    }
    drawn = next;
    above.firstChild.style.height = `${from * rowHeight}px`;
    below.firstChild.style.height = `${(items.length - to) * rowHeight}px`;
    above.hidden = from === 0;
    below.hidden = to === items.length;
    setStops();
    // the row that follows takes the focus of one that is gone
    if (left) controlsOf(grid.rows[Math.min(left, next.size + 1)] ?? below).at(-1)?.focus({ preventScroll: true });
  }

  // ---- walking: the controls of one row alone are in the order of Tab, up and down lead to the others

  const controlsOf = (row) => [...row.querySelectorAll("button, input, select")];
  function setStops() {
    const rows = [...drawn.values()].map((row) => row.element);
    const active = rows.find((row) => row === walked) ?? rows[0];
    for (const row of rows) for (const control of controlsOf(row)) control.tabIndex = row === active ? 0 : -1;
  }
  body.addEventListener("focusin", (event) => {
    walked = event.target.closest("tr");
    setStops();
  });
  body.addEventListener("keydown", (event) => {
    const way = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
    if (!way || event.target.matches("select")) return;
    const at = controlsOf(walked).indexOf(event.target) - controlsOf(walked).length;
    controlsOf(walked[way] ?? above).at(at)?.focus();
    event.preventDefault();
  });

  function rowOf(item, index) {
    const mark = markOf(item);
    const row = drawn.get(keyOf(item)) ?? { element: h("tr", {}), mark: undefined };
    row.element.setAttribute("aria-rowindex", index + 2);
    if (row.mark !== mark && !typedIn(row.element)) {
      row.mark = mark;
      row.element.className = classOf(item) ?? "";
      fill(row.element, draw(item).map((cell, at) => h("td", { class: columns[at].class }, cell)));
      row.element.style.height = `${rowHeight}px`;
    }
    return row;
  }

  const soon = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(update);
  };
  body.addEventListener("focusout", soon);
  element.addEventListener("scroll", soon, { passive: true });
  new ResizeObserver(soon).observe(element);

  return {
    element,
    show(some) {
      items = some;
      grid.setAttribute("aria-rowcount", items.length + 1);
      update();
    },
  };
}

/** What somebody types is not taken from under their hands. */
const typedIn = (row) => row.contains(document.activeElement) && document.activeElement.matches("select, input:not([type=checkbox])");
