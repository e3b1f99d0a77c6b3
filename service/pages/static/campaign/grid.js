// Every frame of the campaign in a grid by the method's axes, with readings, verdicts and gaps. Only lines that are seen exist.

import { act, byId, empty, fill, h, isCommand, isPressed, lettersOn, may, placeAfter } from "../dom.js";
import { number } from "../format.js";
import { ReadingBook } from "./book.js";
import { openFrame } from "./frame.js";
import { bulkOf, showKeys, toolsOf } from "./grid-tools.js";
import { layOut } from "./matrix.js";
import { askWhere, leaveOut, moveTo } from "./moves.js";
import { CARDS, TALLER, gridRows, phone } from "./rows.js";
import { typing } from "./sheet.js";

const ARROWS = { ArrowDown: [1, 0], ArrowUp: [-1, 0], ArrowRight: [0, 1], ArrowLeft: [0, -1] };

const filled = (line) => [...line.cells.keys()].filter((at) => line.cells[at]);
const nearest = (line, column) => filled(line).sort((a, b) => Math.abs(a - column) - Math.abs(b - column))[0];

/** `shown()` answers {lines, offsets, drawn} of the grid, `update()` draws what is in view. */
function walking({ body, head, scroller, shown, update }) {
  let active = null;

  const scrolls = () => scroller.scrollHeight > scroller.clientHeight + 1;
  const cellAt = (line, column) => shown().drawn.get(line)?.element.children[column + 1]?.firstElementChild;
  const place = () => shown().lines.findIndex((line) => line.key === active?.line);

  function setStop() {
    body.querySelectorAll("td > [tabindex='0']").forEach((each) => (each.tabIndex = -1));
    const stop = (active && cellAt(active.line, active.column)) ?? body.querySelector("td > .cell, td > .cell-gap, td > .cell-pile");
    if (stop) stop.tabIndex = 0;
  }

  function walk(index, column) {
    const { lines, offsets } = shown();
    active = { line: lines[index].key, column };
    const [top, bottom] = [offsets[index], offsets[index + 1]];
    if (scrolls()) {
      const room = head.offsetHeight;
      if (top < scroller.scrollTop) scroller.scrollTop = top;
      else if (bottom + room > scroller.scrollTop + scroller.clientHeight) scroller.scrollTop = bottom + room - scroller.clientHeight;
    } else if (!cellAt(active.line, column)) scrollBy(0, body.getBoundingClientRect().top + top - innerHeight / 2);
    update();
    cellAt(active.line, column)?.focus({ preventScroll: scrolls() });
  }

  function aside(by) {
    const { lines } = shown();
    for (let [index, column] = [place(), active.column + by]; lines[index]; column += by) {
      if (lines[index].cells[column]) return walk(index, column);
      if (column >= 0 && column < lines[index].cells.length) continue;
      index += by;
      column = by > 0 ? -1 : (lines[index]?.cells.length ?? 0);
    }
    return null;
  }

  /** From a line on, up or down, to the first that holds something; whether there was one. */
  function along(from, by) {
    const { lines } = shown();
    for (let index = from; index >= 0 && index < lines.length; index += by) {
      const column = nearest(lines[index], active.column);
      if (column !== undefined) {
        walk(index, column);
        return true;
      }
    }
    return false;
  }

  function turnPage(by) {
    const { lines, offsets } = shown();
    const from = place();
    const room = (scrolls() ? scroller.clientHeight : innerHeight) - 2 * head.offsetHeight;
    let to = from;
    while (lines[to + by] && (to === from || Math.abs(offsets[to + by] - offsets[from]) <= room)) to += by;
    if (!along(to, by)) along(to, -by);
  }

  function toEnd(last) {
    const line = place();
    walk(line, filled(shown().lines[line]).at(last ? -1 : 0));
  }

  function toCorner(last) {
    const { lines } = shown();
    active = { line: active.line, column: last ? shown().lines[place()].cells.length : 0 };
    along(last ? lines.length - 1 : 0, last ? -1 : 1);
  }

  body.addEventListener("focusin", (event) => {
    const cell = event.target.closest("td > *");
    if (!cell) return;
    const row = [...shown().drawn].find(([, each]) => each.element.contains(cell));
    active = { line: row[0], column: [...row[1].element.children].indexOf(cell.parentElement) - 1 };
    setStop();
  });

  return {
    setStop,
    line: () => shown().lines[place()],
    focusOn(id) {
      const { lines } = shown();
      const holds = (cell) => cell?.frame?.id === id || cell?.pile?.frames.some((frame) => frame.id === id);
      const index = lines.findIndex((line) => line.cells.some(holds));
      if (index >= 0) walk(index, lines[index].cells.findIndex(holds));
    },
    /** Whether a key of the focused cell was one that walks; then it was done. */
    press({ key, ctrlKey, metaKey, altKey }) {
      const ends = key === "Home" || key === "End";
      if (altKey || metaKey || (ctrlKey && !ends)) return false;
      const [down, right] = ARROWS[key] ?? [0, 0];
      if (down) along(place() + down, down);
      else if (right) aside(right);
      else if (ends) (ctrlKey ? toCorner : toEnd)(key === "End");
      else if (key === "PageDown" || key === "PageUp") turnPage(key === "PageDown" ? 1 : -1);
      else return false;
      return true;
    },
  };
}

const KIND = "text/x-stilb-frames";

/** `pick(id)` answers the frames that go with one, `rowAt(element)` the row of the grid that it is in. */
function dragging(body, { state, pick, rowAt }) {
  const lifts = (row) => row?.kind === "role";
  const clear = () => body.querySelectorAll(".over").forEach((each) => each.classList.remove("over"));
  body.addEventListener("dragstart", (event) => {
    const { id } = event.target.closest?.(".cell")?.dataset ?? {};
    if (!id || !may("calibrate")) return event.preventDefault();
    event.dataTransfer.setData(KIND, JSON.stringify(pick(id)));
    event.dataTransfer.effectAllowed = "move";
    return null;
  });
  body.addEventListener("dragover", (event) => {
    if (!event.dataTransfer.types.includes(KIND)) return;
    clear();
    if (!lifts(rowAt(event.target))) return;
    event.preventDefault();
    event.target.closest("tr").classList.add("over");
  });
  body.addEventListener("dragend", clear);
  body.addEventListener("drop", (event) => {
    clear();
    const row = rowAt(event.target);
    const ids = JSON.parse(event.dataTransfer.getData(KIND) || "[]");
    if (!ids.length || !lifts(row)) return;
    event.preventDefault();
    act(body.closest(".grid"), () => moveTo(state, ids, row));
  });
}

/** {frame, show, find}, each "" where the address does not name it. */
function readAddress() {
  const query = new URLSearchParams(location.search);
  return Object.fromEntries(["frame", "show", "find"].map((name) => [name, query.get(name) ?? ""]));
}

/** Change some of them; with `step` the way back leads to how it was. */
function writeAddress(said, { step = false } = {}) {
  const url = new URL(location.href);
  for (const [name, value] of Object.entries(said)) if (value) url.searchParams.set(name, value);
  else url.searchParams.delete(name);
  if (url.href === location.href) return;
  if (step) history.pushState({ step }, "", url);
  else history.replaceState(history.state, "", url);
}

/** Keep in the history where the scroller is seen and how far it was scrolled; answers what goes there again, once. */
function keepPlace(scroller) {
  const top = () => scroller.getBoundingClientRect().top;
  let place = history.state?.place;
  addEventListener("pagehide", () => history.replaceState({ ...history.state, place: [top(), scroller.scrollTop] }, ""));
  return () => {
    if (!place) return;
    const [before, scrolled] = place;
    place = undefined;
    scroller.scrollTop = scrolled;
    // what is loaded above it later does not move what is seen
    scrollBy(0, top() - before);
  };
}

const MARGIN = 3;
/** A grid that is higher scrolls by itself, so that the sections below it stay near. */
const TALL_PX = 2000;

export function gridSection(state) {
  const { method, pictures } = state;
  const chosen = new Set();
  const { show: outcome, find: text } = readAddress();
  const view = { outcome, text };
  const book = new ReadingBook(state);
  const unfolded = new Set();
  let model = { columns: [], lines: [], order: [] };
  let offsets = [0];
  let drawn = new Map();
  let sheet = null;
  let named = false;
  let stale = true;
  let waiting = false;

  const body = h("tbody", { role: "rowgroup" });
  const head = h("thead", { role: "rowgroup" });
  const [above, below] = [h("tr", { role: "presentation", class: "space" }), h("tr", { role: "presentation", class: "space" })];
  const table = h("table", { role: "grid", "aria-label": "Frames", "aria-multiselectable": "true" }, h("colgroup"), head, body);
  const scroller = h("div", { class: "grid" }, table);
  const bare = h("div");
  const caption = h("p", { class: "caption" }, may("calibrate") ? "Drag a picture to another row to move it. " : null, "Arrow keys walk the grid, ", h("kbd", {}, "Enter"), " opens a frame, ", may("calibrate") ? [h("kbd", {}, "M"), " moves, ", h("kbd", {}, "X"), " leaves out, ", h("kbd", {}, "Z"), " undoes, "] : null, h("kbd", {}, "?"), " shows all keys.");

  const { reads, isCompact, heightOf, drawHead, rowOf } = gridRows({ method, book, chosen, table, shown: () => ({ model, drawn }), choose: (ids) => choose(ids) });
  const typed = typing({ body, book, lines: () => model.lines, bring: (line) => bring(line), leave: (line) => focusOn(line?.cells.find((cell) => cell?.frame)?.frame.id) });
  const { element: tools, outcomes, drawCounts } = toolsOf({ state, paste: typed.paste, book, view, reads, draw: () => draw(), selectAll: () => choose(model.order.map((frame) => frame.id)) });
  const { element: bulk, drawBulk } = bulkOf({ state, chosen, clear: () => choose([...chosen], false), rest: () => body.querySelector("td > [tabindex='0']")?.focus() });

  const goBack = keepPlace(scroller);

  const shows = (frame) => {
    const outcome = frame.left_out !== null ? "out" : frame.outcome;
    return (!view.outcome || view.outcome === outcome) && `${frame.filename} ${frame.role} ${frame.scene ?? ""}`.toLowerCase().includes(view.text.toLowerCase());
  };

  function draw() {
    if (isPressed(outcomes)) return void requestAnimationFrame(draw);
    const some = state.frames.length + state.withdrawn.length + book.readings.length > 0;
    fill(bare, some ? null : empty("No frames yet", may("upload") ? "Drop the camera’s files above, or send a folder with: stilb push." : "No frames have been sent.", ...(reads && may("calibrate") ? [h("button", { type: "button", onclick: typed.paste }, "Paste readings…")] : [])));
    for (const part of [tools, scroller, caption]) part.hidden = !some;
    model = layOut({ method, frames: state.frames, withdrawn: state.withdrawn, readings: book.readings, gaps: state.gaps, across: phone.matches ? 3 : 6, perCard: phone.matches ? CARDS : 0, unfolded, shows, showsGaps: !view.text && ["", "gap"].includes(view.outcome) });
    if (view.outcome === "gap") model.lines = model.lines.filter((line) => line.cells.some((cell) => cell?.gap));
    offsets = [0];
    for (const line of model.lines) offsets.push(offsets.at(-1) + heightOf(line));
    scroller.classList.toggle("tall", offsets.at(-1) > TALL_PX * (phone.matches ? TALLER : 1));
    table.classList.toggle("compact", isCompact());
    table.classList.toggle("flow", !model.columns[0]?.heads.length);
    table.setAttribute("aria-rowcount", model.lines.length + head.children.length);
    table.setAttribute("aria-colcount", model.columns.length + 1);
    drawHead();
    stale = true;
    update();
    drawCounts();
    drawBulk();
    writeAddress({ show: view.outcome, find: view.text });
    if (state.complete) {
      goBack();
      // at first: from then on the address follows what is opened
      if (!named) openNamed();
      if (!named && location.hash === "#readings") typed.first();
      named = true;
    }
    byId("frames-note").textContent = state.frames.length ? `${number(state.frames.length, 6)}${state.complete ? "" : " and more"} of this campaign` : "";
  }

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
    placeAfter(above, next.values());
    drawn = next;
    // the focus goes with its frame, so that a key never acts on another one
    if (held && document.activeElement.dataset.id !== held) body.querySelector(`[data-id="${held}"]`)?.focus({ preventScroll: true });
    above.style.height = `${offsets[from]}px`;
    below.style.height = `${offsets.at(-1) - offsets[to]}px`;
    above.hidden = from === 0;
    below.hidden = to === model.lines.length;
    walker.setStop();
    pictures.show();
  }

  function fold(pile) {
    if (!unfolded.delete(pile)) unfolded.add(pile);
    draw();
    body.querySelector(`[data-pile="${CSS.escape(pile)}"]`)?.focus();
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

  /** Open a frame: the way back closes it, and to close it is the way back. */
  function open(id) {
    writeAddress({ frame: id }, { step: true });
    show(id);
  }
  function show(id) {
    const opened = (sheet = openFrame(state, id, {
      order: model.order,
      walked: (frame) => writeAddress({ frame }),
      back(last) {
        // the history closes a frame first, and may have opened one again before this is told
        const isClosed = sheet !== opened;
        if (!isClosed) sheet = null;
        if (!sheet) focusOn(last);
        if (isClosed || !readAddress().frame) return;
        if (history.state?.step) history.back();
        else writeAddress({ frame: "" });
      },
    }));
  }
  const openNamed = () => {
    const { frame } = readAddress();
    if (sheet && frame) sheet.show(frame);
    else if (sheet) {
      const { close } = sheet;
      sheet = null;
      close();
    } else if (state.byId.has(frame)) show(frame);
    else writeAddress({ frame: "" });
  };
  addEventListener("popstate", () => state.left || openNamed());

  function bring(line) {
    const top = offsets[model.lines.indexOf(line)];
    if (scroller.scrollHeight > scroller.clientHeight + 1) scroller.scrollTop = top;
    else scrollBy(0, body.getBoundingClientRect().top + top - innerHeight / 2);
    update();
  }

  body.addEventListener("keydown", (event) => {
    if (event.target.dataset.reading !== undefined) return typed.press(event);
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
    else if (letter === "r" && reads) typed.go(walker.line());
    else return null;
    event.preventDefault();
    if (walked && event.shiftKey && can) {
      const moved = document.activeElement.dataset.id;
      choose([id, moved].filter(Boolean), true);
    }
    return null;
  });

  body.addEventListener("click", (event) => {
    const { id, pile } = event.target.closest(".cell, .cell-pile")?.dataset ?? {};
    if (pile) return void fold(pile);
    if (!id) return;
    if ((event.ctrlKey || event.metaKey || event.shiftKey) && may("calibrate")) choose([id]);
    else open(id);
  });

  dragging(body, { state, pick, rowAt: (target) => [...drawn.values()].find(({ element }) => element.contains(target))?.line.row });

  const soon = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(update);
  };
  scroller.addEventListener("scroll", soon, { passive: true });
  addEventListener("scroll", soon, { passive: true });
  new ResizeObserver(soon).observe(scroller);
  phone.addEventListener("change", () => state.left || draw());
  body.addEventListener("focusout", () => {
    stale = true;
    soon();
  });
  document.addEventListener("keydown", (event) => !state.left && event.key === "?" && isCommand(event) && showKeys());
  book.addEventListener("change", draw);
  state.on("frames", draw);
  if (reads) state.on("campaign", () => book.refresh());
  // "Enter readings", wherever it is offered, leads to the first scene without one; also where the address is that already
  document.addEventListener("click", (event) => {
    if (state.left || !event.target.closest('a[href="#readings"]')) return;
    event.preventDefault();
    typed.first();
  });
  draw();
  state.book = book;
  return [bare, tools, bulk, scroller, caption];
}
