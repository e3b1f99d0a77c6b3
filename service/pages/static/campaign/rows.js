// The rows of the grid and its heads, drawn where they differ from what is there.

import { fill, h, may } from "../dom.js";
import { frameCell, gapCell, lookOf, pileCell } from "./cells.js";
import { extraHeight, lookOfHead, sceneHead } from "./scene.js";

/** Heights of a line [px], as in campaign.css: with a reading, without, compact, and on a phone. */
const [READ_PX, LINE_PX, COMPACT_PX] = [112, 76, 56];
const PHONE = { read: 104, head: 44, cells: 140, between: 16 };
/** Cells of a line on a phone, and how much higher a grid may be there. */
export const [CARDS, TALLER] = [12, 8];
const MOST_WIDE = 8;
export const phone = matchMedia("(max-width: 40rem)");

/** Rows of the `table`; `shown()` answers {model, drawn} of the grid, `choose(ids)` selects frames. */
export function gridRows({ method, book, chosen, table, shown, choose }) {
  const reads = method.reference === "meter";
  const [columns, head] = [table.querySelector("colgroup"), table.tHead];
  const isCompact = () => !phone.matches && shown().model.columns.length > MOST_WIDE;

  function heightOf(line) {
    const hasReading = reads && line.row.kind === "role" && line.row.value !== null && method.grid.rows === "scene";
    const extra = line.first && hasReading ? extraHeight(book, line.row.value) : 0;
    if (phone.matches) return extra + (line.first ? (hasReading ? PHONE.read : PHONE.head) : 0) + Math.ceil(line.cells.filter(Boolean).length / 3) * PHONE.cells + PHONE.between;
    return line.first && hasReading ? READ_PX + extra : isCompact() ? COMPACT_PX : LINE_PX;
  }

  function drawHead() {
    const { model } = shown();
    const text = JSON.stringify(model.columns);
    if (head.dataset.of === text) return;
    head.dataset.of = text;
    fill(columns, h("col", { class: "head" }), model.columns.map(() => h("col")));
    const depth = model.columns[0]?.heads.length ?? 0;
    const first = (attributes) => h("th", { role: "columnheader", scope: "col", ...attributes }, reads ? "Scene and luminance" : method.grid.rows ? "Row" : "Frames");
    fill(head, Array.from({ length: depth }, (_, level) => {
      const spans = [];
      for (const [at, { heads }] of model.columns.entries()) {
        const same = at && level < depth - 1 && model.columns[at - 1].heads.slice(0, level + 1).join() === heads.slice(0, level + 1).join();
        if (same) spans.at(-1).span += 1;
        else spans.push({ text: heads[level], span: 1, starts: startsGroup(at) });
      }
      return h("tr", { role: "row" }, level ? null : first({ rowspan: depth }), spans.map(({ text: said, span, starts }) => h("th", { role: "columnheader", scope: span > 1 ? "colgroup" : "col", colspan: span, class: starts ? "starts" : null }, said)));
    }));
  }

  const startsGroup = (at) => at === 0 || shown().model.columns[at].heads[0] !== shown().model.columns[at - 1].heads[0];

  function rowOf(line, index) {
    const { model, drawn } = shown();
    const row = drawn.get(line.key) ?? { element: h("tr", { role: "row" }, h("th", { role: "rowheader", scope: "row" })), marks: [] };
    const { element } = row;
    element.className = `${line.first ? "" : "more "}${line.row.kind}`;
    element.style.height = `${heightOf(line)}px`;
    element.setAttribute("aria-rowindex", index + 1 + head.children.length);
    row.line = line;
    const headMark = JSON.stringify([line.row.label, line.first && reads ? lookOfHead(book, line.row.value) : 0]);
    if (row.head !== headMark && !typedIn(element.firstChild)) {
      row.head = headMark;
      const typing = element.firstChild.contains(document.activeElement) && document.activeElement.matches("[data-reading]");
      fill(element.firstChild, line.first ? headOf(line.row) : h("span", { class: "hidden" }, line.row.label));
      // selected: what is typed next takes the place of the new value
      if (typing) element.firstChild.querySelector("[data-reading]")?.select();
    }
    while (element.children.length > line.cells.length + 1) element.lastChild.remove();
    while (element.children.length < line.cells.length + 1) element.append(h("td", { role: "gridcell" }));
    for (const [at, cell] of line.cells.entries()) {
      const text = JSON.stringify([cell?.frame ? [lookOf(cell.frame), chosen.has(cell.frame.id)] : (cell?.gap ?? cell?.pile ?? null), table.className]);
      if (row.marks[at] === text) continue;
      row.marks[at] = text;
      const td = element.children[at + 1];
      const column = cell?.column ?? at;
      const heads = model.columns[column]?.heads ?? [];
      const place = [line.row.label, ...heads].join(", ");
      const focused = td.contains(document.activeElement);
      td.className = heads.length && startsGroup(column) ? "starts" : "";
      td.dataset.head = heads.join(" · ");
      if (cell?.frame) td.setAttribute("aria-selected", String(chosen.has(cell.frame.id)));
      else td.removeAttribute("aria-selected");
      fill(td, contentOf(cell, place) ?? (line.row.kind === "role" && heads.length ? h("span", { class: "cell-none" }, h("span", { class: "hidden" }, "not needed"), h("span", { "aria-hidden": "true" }, line.first ? "–" : "")) : null));
      if (focused) td.firstChild?.focus();
    }
    return row;
  }

  function contentOf(cell, place) {
    const compact = isCompact();
    if (cell?.frame) return frameCell(cell.frame, { place, chosen: chosen.has(cell.frame.id), compact });
    if (cell?.gap) return gapCell(cell.gap, { place, compact });
    return cell?.pile ? pileCell(cell.pile, { place }) : null;
  }

  function headOf(row) {
    const menu = row.frames.length && may("calibrate") ? h("button", { type: "button", class: "menu-dots", "aria-label": `Select the frames of ${row.label}`, title: "Select these frames", onclick: () => choose(row.frames.map((frame) => frame.id)) }, "···") : null;
    if (reads && row.kind === "role" && row.value !== null && method.grid.rows === "scene") return sceneHead(row, book, { menu });
    return h("div", { class: "scene-name" }, h("span", {}, row.label), menu);
  }

  return { reads, isCompact, heightOf, drawHead, rowOf };
}

/** What somebody types is not taken from under their hands. */
const typedIn = (place) => place.contains(document.activeElement) && document.activeElement.matches("input") && document.activeElement.value !== document.activeElement.defaultValue;
