// Every frame of the campaign in a grid by the method's axes, with readings, verdicts and gaps. Only lines that are seen exist.

import { all } from "../api.js";
import { byId, fill, h, isPressed, may } from "../dom.js";
import { number } from "../format.js";
import { OUTCOMES, mark } from "../marks.js";
import { act, empty } from "../states.js";
import { undoLast } from "../undo.js";
import { bulkForm } from "./bulk.js";
import { frameCell, gapCell, lookOf } from "./cells.js";
import { dragging } from "./dragging.js";
import { openFrame } from "./frame.js";
import { lettersOn, showKeys } from "./keys.js";
import { layOut } from "./matrix.js";
import { askForMeter } from "./meters.js";
import { askWhere, leaveOut } from "./moves.js";
import { ReadingBook, readingTools, sceneHead } from "./scene.js";
import { walking } from "./walking.js";

const MARGIN = 3;
/** Heights of a line [px], as in campaign.css: with a reading, without, compact, and on a phone. */
const [READ_PX, LINE_PX, COMPACT_PX] = [112, 76, 56];
const PHONE = { read: 104, head: 44, cells: 140, between: 16, cards: 12 };
const MOST_WIDE = 8;
/** Thumbnails are asked for when scrolling has come to rest for so long. */
const REST_MS = 120;
/** A grid that is higher scrolls by itself, so that the sections below it stay near. */
const TALL_PX = 2000;
const phone = matchMedia("(max-width: 40rem)");

export function gridSection(state) {
  const { method, pictures } = state;
  const chosen = new Set();
  const view = { outcome: "", text: "" };
  const book = new ReadingBook(state);
  const reads = method.reference === "meter";
  let model = { columns: [], lines: [], order: [] };
  let offsets = [0];
  let drawn = new Map();
  let stale = true;
  let waiting = false;
  let resting;
  let scrolled = -Infinity;

  const body = h("tbody", { role: "rowgroup" });
  const head = h("thead", { role: "rowgroup" });
  const columns = h("colgroup");
  const [above, below] = [h("tr", { role: "presentation", class: "space" }), h("tr", { role: "presentation", class: "space" })];
  const table = h("table", { role: "grid", "aria-label": "Frames", "aria-multiselectable": "true" }, columns, head, body);
  const scroller = h("div", { class: "grid" }, table);
  const tools = h("div", { class: "grid-tools" });
  const bulk = h("div", { class: "bulk card", hidden: true });
  const bare = h("div");
  const caption = h("p", { class: "caption" }, "Drag a picture to another row to move it. Arrow keys walk the grid, ", h("kbd", {}, "Enter"), " opens a frame, ", h("kbd", {}, "M"), " moves, ", h("kbd", {}, "X"), " leaves out, ", h("kbd", {}, "Z"), " undoes, ", h("kbd", {}, "?"), " shows all keys.");

  const shows = (frame) => {
    const outcome = frame.left_out !== null ? "out" : frame.outcome;
    return (!view.outcome || view.outcome === outcome) && `${frame.filename} ${frame.role} ${frame.scene ?? ""}`.toLowerCase().includes(view.text);
  };
  const isCompact = () => !phone.matches && model.columns.length > MOST_WIDE;

  function draw() {
    if (isPressed(outcomes)) return void requestAnimationFrame(draw);
    const some = state.frames.length + state.withdrawn.length + book.readings.length > 0;
    fill(bare, some ? null : empty("No frames yet", may("upload") ? "Drop the camera’s files above, or send a folder with: stilb push." : "No frames have been sent."));
    for (const part of [tools, scroller, caption]) part.hidden = !some;
    model = layOut({ method, frames: state.frames, withdrawn: state.withdrawn, readings: book.readings, gaps: state.gaps, across: phone.matches ? 3 : 6, perCard: phone.matches ? PHONE.cards : 0, shows, showsGaps: !view.text && ["", "gap"].includes(view.outcome) });
    pictures.arrange(model.order);
    if (view.outcome === "gap") model.lines = model.lines.filter((line) => line.cells.some((cell) => cell?.gap));
    offsets = [0];
    for (const line of model.lines) offsets.push(offsets.at(-1) + heightOf(line));
    scroller.classList.toggle("tall", offsets.at(-1) > TALL_PX * (phone.matches ? 8 : 1));
    table.classList.toggle("compact", isCompact());
    table.classList.toggle("flow", !model.columns[0]?.heads.length);
    table.setAttribute("aria-rowcount", model.lines.length + head.children.length);
    table.setAttribute("aria-colcount", model.columns.length + 1);
    drawHead();
    stale = true;
    update();
    drawCounts();
    drawBulk();
    byId("frames-note").textContent = state.frames.length ? `${number(state.frames.length, 6)}${state.complete ? "" : " and more"} of this campaign` : "";
  }

  function heightOf(line) {
    const hasReading = reads && line.row.kind === "role" && line.row.value !== null && method.grid.rows === "scene";
    if (phone.matches) return (line.first ? (hasReading ? PHONE.read : PHONE.head) : 0) + Math.ceil(line.cells.filter(Boolean).length / 3) * PHONE.cells + PHONE.between;
    return line.first && hasReading ? READ_PX : isCompact() ? COMPACT_PX : LINE_PX;
  }

  function drawHead() {
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

  const startsGroup = (at) => at === 0 || model.columns[at].heads[0] !== model.columns[at - 1].heads[0];

  function update() {
    waiting = false;
    if (isPressed(body)) return soon();
    const held = body.contains(document.activeElement) ? document.activeElement.dataset.id : undefined;
    const rect = scroller.getBoundingClientRect();
    const inner = scroller.scrollHeight > scroller.clientHeight + 1;
    const top = inner ? scroller.scrollTop : Math.max(0, -rect.top);
    const height = inner ? scroller.clientHeight : innerHeight;
    const at = (offset) => {
      let [low, high] = [0, model.lines.length];
      while (low < high) {
        const middle = (low + high) >> 1;
        if (offsets[middle + 1] <= offset) low = middle + 1;
        else high = middle;
      }
      return low;
    };
    const from = Math.max(0, at(top) - MARGIN);
    const to = Math.min(model.lines.length, at(top + height) + MARGIN + 1);
    const next = new Map();
    for (let index = from; index < to; index += 1) {
      const { key } = model.lines[index];
      // scrolling alone changes no row
      next.set(key, (!stale && drawn.get(key)) || rowOf(model.lines[index], index));
    }
    stale = false;
    for (const [key, row] of drawn) if (!next.has(key)) row.element.remove();
    if (!above.isConnected) body.append(above, below);
    let place = above;
    for (const row of next.values()) {
      // moved only where it must be: a row that stays keeps its focus
      if (place.nextSibling !== row.element) place.after(row.element);
      place = row.element;
    }
    drawn = next;
    // the focus goes with its frame, so that a key never acts on another one
    if (held && document.activeElement.dataset.id !== held) body.querySelector(`[data-id="${held}"]`)?.focus({ preventScroll: true });
    above.style.height = `${offsets[from]}px`;
    below.style.height = `${offsets.at(-1) - offsets[to]}px`;
    above.hidden = from === 0;
    below.hidden = to === model.lines.length;
    walker.setStop();
    clearTimeout(resting);
    pictures.put();
    if (performance.now() - scrolled > REST_MS) pictures.show();
    else resting = setTimeout(() => pictures.show(), REST_MS);
  }

  function rowOf(line, index) {
    const row = drawn.get(line.key) ?? { element: h("tr", { role: "row" }, h("th", { role: "rowheader", scope: "row" })), marks: [] };
    const { element } = row;
    element.className = `${line.first ? "" : "more "}${line.row.kind}`;
    element.style.height = `${heightOf(line)}px`;
    element.setAttribute("aria-rowindex", index + 1 + head.children.length);
    row.line = line;
    const headMark = JSON.stringify([line.row.label, line.first && reads ? [book.readings.filter((each) => each.scene === line.row.value), book.unit, book.meter_id, book.meters.length] : 0]);
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
      const text = JSON.stringify([cell?.frame ? [lookOf(cell.frame), chosen.has(cell.frame.id)] : (cell?.gap ?? null), table.className]);
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
      fill(td, cell?.frame ? frameCell(cell.frame, { place, chosen: chosen.has(cell.frame.id), compact: isCompact() }) : cell?.gap ? gapCell(cell.gap, { place, compact: isCompact() }) : line.row.kind === "role" && heads.length ? h("span", { class: "cell-none" }, h("span", { class: "hidden" }, "not needed"), h("span", { "aria-hidden": "true" }, line.first ? "–" : "")) : null);
      if (focused) td.firstChild?.focus();
    }
    return row;
  }

  function headOf(row) {
    const menu = row.frames.length && may("calibrate") ? h("button", { type: "button", class: "menu-dots", "aria-label": `Select the frames of ${row.label}`, title: "Select these frames", onclick: () => choose(row.frames.map((frame) => frame.id)) }, "···") : null;
    if (reads && row.kind === "role" && row.value !== null && method.grid.rows === "scene") return sceneHead(row, book, { menu });
    return h("div", { class: "scene-name" }, h("span", {}, row.label), menu);
  }

  function choose(ids, on = !ids.every((id) => chosen.has(id))) {
    for (const id of ids) if (on) chosen.add(id);
    else chosen.delete(id);
    stale = true;
    update();
    drawBulk();
  }

  const walker = walking({ body, head, scroller, shown: () => ({ lines: model.lines, offsets, drawn }), update });
  const { focusOn } = walker;
  const pick = (id) => (chosen.has(id) ? [...chosen] : [id]);
  const open = (id) => openFrame(state, id, { order: model.order, back: (last) => focusOn(last) });
  const toReading = () => body.querySelector(`[data-reading="${CSS.escape(walker.line()?.row.value ?? "")}"]`)?.focus();

  body.addEventListener("keydown", (event) => {
    if (event.target.dataset.reading !== undefined) return typedReading(event);
    if (!event.target.closest("td")) return null;
    const walked = walker.press(event);
    if (!walked && (event.ctrlKey || event.metaKey || event.altKey)) return null;
    const { id } = event.target.dataset;
    const letter = lettersOn() ? event.key.toLowerCase() : "";
    const can = may("calibrate");
    if (walked);
    else if (event.key === " " && id && can) choose([id]);
    else if (letter === "m" && id && can) askWhere(state, pick(id));
    else if (letter === "x" && id && can) act(scroller, () => leaveOut(state, pick(id)));
    else if (letter === "r" && reads) toReading();
    else return null;
    event.preventDefault();
    if (walked && event.shiftKey && can) {
      const moved = document.activeElement.dataset.id;
      choose([id, moved].filter(Boolean), true);
    }
    return null;
  });

  const scenesRead = () => model.lines.filter((line) => line.first && reads && line.row.kind === "role" && line.row.value !== null).map((line) => line.row.value);

  /** Cells of a spreadsheet go down the rows; one value is pasted as it is. */
  body.addEventListener("paste", (event) => {
    const text = event.clipboardData.getData("text/plain");
    const { reading } = event.target.dataset;
    if (reading === undefined || !/[\n\r\t]./.test(text.trimEnd())) return;
    event.preventDefault();
    act(event.target, () => book.pasted(text, scenesRead().slice(scenesRead().indexOf(reading))));
  });

  /** Enter records a value and goes to the next scene without one. */
  async function typedReading(event) {
    if (event.key === "Escape") return focusOn(model.lines.find((line) => line.row.value === event.target.dataset.reading)?.cells.find((cell) => cell?.frame)?.frame.id);
    if (event.key !== "Enter") return null;
    event.preventDefault();
    const scene = event.target.dataset.reading;
    const known = (name) => book.readings.some((each) => each.scene === name && !each.withdrawn_at);
    const scenes = scenesRead();
    const following = [...scenes.slice(scenes.indexOf(scene) + 1), ...scenes].find((name) => name !== scene && !known(name));
    event.target.blur();
    const index = model.lines.findIndex((line) => line.row.value === following);
    if (index < 0) return null;
    if (scroller.scrollHeight > scroller.clientHeight + 1 && !body.querySelector(`[data-reading="${CSS.escape(following)}"]`)) scroller.scrollTop = offsets[index];
    update();
    body.querySelector(`[data-reading="${CSS.escape(following)}"]`)?.focus();
    return null;
  }

  body.addEventListener("click", (event) => {
    const { id } = event.target.closest(".cell")?.dataset ?? {};
    if (!id) return;
    if ((event.ctrlKey || event.metaKey || event.shiftKey) && may("calibrate")) choose([id]);
    else open(id);
  });

  dragging(body, { state, pick, rowAt: (target) => [...drawn.values()].find(({ element }) => element.contains(target))?.line.row });

  // ---- tools

  const outcomes = h("div", { class: "segments", role: "group", "aria-label": "Which frames" });
  function drawCounts() {
    const count = (outcome) => state.frames.filter((frame) => (outcome === "out" ? frame.left_out !== null : frame.left_out === null && frame.outcome === outcome)).length;
    const options = [["", "All", null, state.frames.length], ...Object.entries(OUTCOMES).map(([outcome, [kind, said]]) => [outcome, said, kind, count(outcome)]), ["out", "Left out", "out", count("out")], ["gap", "Gaps", "gap", state.gaps.length]];
    fill(outcomes, options.filter(([name, , , of]) => name === "" || of || view.outcome === name).map(([name, said, kind, of]) =>
      h("button", { type: "button", "aria-pressed": String(view.outcome === name), "data-keep": `outcome ${name}`, onclick: () => ((view.outcome = name), draw()) }, kind ? mark(kind) : null, " ", said, " ", h("small", {}, number(of, 6)))));
  }

  function drawBulk() {
    const held = bulk.contains(document.activeElement);
    for (const id of chosen) if (!state.byId.has(id)) chosen.delete(id);
    bulk.hidden = chosen.size === 0;
    if (chosen.size && !bulk.firstChild) fill(bulk, bulkForm(state, chosen, () => choose([...chosen], false)));
    if (!chosen.size) {
      fill(bulk);
      if (held) body.querySelector("td > [tabindex='0']")?.focus();
    } else bulk.querySelector(".bulk-count").textContent = `${number(chosen.size, 6)} selected`;
  }

  const meters = async () => book.refresh(await all("/v1/meters"));
  const register = async () => {
    const made = await askForMeter();
    if (!made) return;
    await meters();
    book.meter_id = made.id;
  };
  fill(
    tools,
    outcomes,
    h("input", { type: "search", "aria-label": "Find a frame", placeholder: "Name, role or scene", oninput: (event) => ((view.text = event.target.value.trim().toLowerCase()), draw()) }),
    may("calibrate") ? h("button", { type: "button", class: "quiet small-button", onclick: () => choose(model.order.map((frame) => frame.id)) }, "Select all") : null,
    h("button", { type: "button", class: "quiet small-button", "aria-label": "Keys", onclick: showKeys }, h("kbd", {}, "?")),
    reads && may("calibrate") ? readingTools(book, register) : null,
  );
  const soon = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(update);
  };
  const flies = () => {
    scrolled = performance.now();
    soon();
  };
  scroller.addEventListener("scroll", flies, { passive: true });
  addEventListener("scroll", flies, { passive: true });
  new ResizeObserver(soon).observe(scroller);
  phone.addEventListener("change", () => state.left || draw());
  body.addEventListener("focusout", () => {
    stale = true;
    soon();
  });
  document.addEventListener("keydown", (event) => {
    if (event.target.closest("input, select, textarea, dialog:not(.frame-sheet)") || event.ctrlKey || event.metaKey || event.altKey || !lettersOn()) return;
    if (event.key.toLowerCase() === "z") undoLast();
    else if (event.key === "?") showKeys();
  });
  book.addEventListener("change", draw);
  state.on("frames", draw);
  state.on("open-frame", ({ detail }) => open(detail));
  if (reads) {
    let seen = "";
    state.on("campaign", () => {
      // somebody else's readings: the campaign says how many there are
      if (seen !== String(state.campaign.readings)) book.refresh();
      seen = String(state.campaign.readings);
    });
    meters();
  }
  // "Enter readings", wherever it is offered, leads to the first scene without one
  addEventListener("hashchange", () => {
    const due = location.hash === "#readings" && body.querySelector("input.due");
    if (due) due.focus();
  });
  draw();
  state.book = book;
  return [bare, tools, bulk, scroller, caption];
}

/** What somebody types is not taken from under their hands. */
const typedIn = (place) => place.contains(document.activeElement) && document.activeElement.matches("input") && document.activeElement.value !== document.activeElement.defaultValue;
