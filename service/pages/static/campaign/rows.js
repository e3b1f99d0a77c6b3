// The rows of the grid and its heads, drawn where they differ from what is there.

import { OUTCOMES, fill, h, mark, may } from "../dom.js";
import { exposureTime, number, stateWords, typeset } from "../format.js";
import { imageOf } from "./pictures.js";
import { extraHeight, lookOfHead, sceneHead } from "./scene.js";

/** The mark of a frame: that of its verdict, unless it was left out. */
export const kindOf = (frame) => (frame.withdrawn || frame.left_out !== null ? "out" : OUTCOMES[frame.outcome][0]);

/** Its state in a word. */
export function sayState(frame) {
  if (frame.withdrawn) return "Withdrawn";
  if (frame.left_out !== null) return "Left out";
  return OUTCOMES[frame.outcome][1];
}

const sayExposure = (frame) => (frame.exposure_time_s ? `${exposureTime(frame.exposure_time_s)}, f/${number(frame.f_number, 3)}, ISO ${frame.iso}` : "no exposure");

const thumbnail = (frame) =>
  frame.thumbnail
    ? h("img", { class: "picture", ...imageOf(frame), alt: "", decoding: "async", width: 76, height: 57, draggable: "false" })
    : h("span", { class: "picture" }, mark(frame.state === "refused" ? "bad" : "wait"));

/** What changes the look of a frame's cell. */
const lookOf = (frame) => [frame.id, frame.state, frame.outcome, frame.code, frame.left_out, frame.withdrawn, frame.signal_dn, frame.exposure_time_s, frame.scene, frame.thumbnail];

export function frameCell(frame, { place, chosen, compact }) {
  const kind = kindOf(frame);
  const why = ["warn", "bad"].includes(kind) && frame.code ? stateWords(frame.code) : kind === "out" ? sayState(frame).toLowerCase() : frame.state === "received" ? "received" : "";
  return h(
    "button",
    { type: "button", class: `cell ${kind}${chosen ? " chosen" : ""}`, tabindex: "-1", draggable: "true", "data-id": frame.id, "aria-label": `${frame.filename}: ${[place, sayExposure(frame), sayState(frame).toLowerCase(), why].filter(Boolean).join(", ")}${chosen ? ", selected" : ""}`, title: frame.detail ?? frame.filename },
    thumbnail(frame),
    h("span", { class: "pv" }, mark(kind)),
    compact ? null : h("span", { class: "says" }, h("b", {}, frame.exposure_time_s ? exposureTime(frame.exposure_time_s) : frame.filename), frame.signal_dn === null ? null : `${number(frame.signal_dn, 4)} DN`, why ? h("em", {}, why) : null),
  );
}

/** A suggested time, as cameras mark theirs. */
const suggest = (seconds) => (seconds < 0.3 ? `1/${Number((1 / seconds).toPrecision(2))} s` : `${Number(seconds.toPrecision(2))} s`);

function gapCell(gap, { place, compact }) {
  const how = typeset([gap.exposure_time_s && suggest(gap.exposure_time_s), gap.text].filter(Boolean).join(": "));
  return h(
    "button",
    { type: "button", class: "cell-gap", tabindex: "-1", title: how, "aria-label": `${["To photograph", place, how].filter(Boolean).join(", ")}` },
    compact ? h("b", {}, "+") : [h("b", {}, "To photograph"), h("span", {}, how)],
  );
}

/** The repeats of a cell that are not shown each, with their count; and the way back. */
function pileCell({ key, more, toCheck }, { place }) {
  const said = more ? `${number(more, 6)} more` : "Show fewer";
  const check = toCheck ? `${number(toCheck, 6)} to check` : "";
  return h(
    "button",
    { type: "button", class: "cell-pile", tabindex: "-1", "data-pile": key, "aria-expanded": String(!more), "aria-label": [said, place, check].filter(Boolean).join(", ") },
    h("b", {}, said),
    check ? h("span", {}, mark("warn"), " ", check) : null,
  );
}

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
