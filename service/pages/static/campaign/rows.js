// The rows of the grid and its heads, drawn where they differ from what is there.

import { ask, decimal } from "../ask.js";
import { small } from "../causes.js";
import { OUTCOMES, act, done, fill, h, mark, may, openDialog, svg, table, take, toast } from "../dom.js";
import { counted, exposureTime, number, percent, stateWords, time, typeset } from "../format.js";
import { written } from "./book.js";
import { nameOfMeter } from "./target.js";
import { imageOf } from "./state.js";
import { UNITS } from "./sheet.js";

/** Readings of one scene that differ by more than this are marked. */
const WIDE = 0.03;
const DIGITS = 15; // a figure as it was entered: none is lost
/** Heights [px] of what a scene's row has beside one reading: another one, a line, and a note. */
const HEIGHTS = { reading: 36, line: 24, note: 84 };

/** The luminance readings of a scene that count: {items, others, mean, unit, spread}; the mean in the unit in which all were entered. */
function summarise(here) {
  const standing = here.filter((each) => !each.withdrawn_at);
  const items = standing.filter((each) => each.quantity === UNITS["cd/m2"]);
  const unit = items.every((each) => each.entered_unit === items[0].entered_unit) ? items[0]?.entered_unit : items[0].unit;
  const values = items.map((each) => (each.entered_unit === unit ? each.entered_value : each.value));
  const mean = values.length ? values.reduce((sum, each) => sum + each, 0) / values.length : null;
  return { items, unit, mean, others: standing.length - items.length, spread: values.length > 1 ? (Math.max(...values) - Math.min(...values)) / mean : null };
}

/** What a scene's row shows: its fields, the reading that its last one replaced, and what has to be said of it. */
function look(book, scene) {
  const found = summarise(book.of(scene));
  const told = book.told.get(scene);
  const fields = told?.repeats || !found.items.length ? [...found.items, null] : found.items;
  const before = book.of(scene).findLast((each) => found.items.some((item) => item.created_at === each.withdrawn_at));
  return { ...found, told, fields, before, doubt: told?.theirs ? null : book.doubtOf(scene) };
}

function extraHeight(book, scene) {
  const { fields, told, before, doubt } = look(book, scene);
  const second = told?.undo ? fields.length > 1 : told?.same || told?.waits || before;
  return (fields.length - 1) * HEIGHTS.reading + (second ? HEIGHTS.line : 0) + (told?.theirs || doubt ? HEIGHTS.note : 0);
}

const lookOfHead = (book, scene) => [book.of(scene), book.told.get(scene), book.doubtOf(scene), book.unit, book.meter_id, book.meters.length];

function sceneHead(row, book, { menu }) {
  const { items, others, mean, spread, told, fields, before, doubt } = look(book, row.value);
  const said = !items.length ? (others ? counted(others, "illuminance reading") : "No reading yet") : items.length === 1 ? "1 reading" : `mean ${number(mean, 3)}, spread ${percent(spread)}`;
  const link = (text, action) => h("button", { type: "button", class: "link-button", onclick: (event) => act(event.target, action) }, text);
  const can = may("calibrate");
  const repeat = (text) => link(text ? `+ repeat with ${text}` : "+ repeat", () => (text ? book.put(row.value, text) : book.tell(row.value, { repeats: true })));
  const entered = (each) => number(each.entered_value, DIGITS);
  return [
    h("div", { class: "scene-name" }, h("span", {}, row.label), menu),
    fields.map((reading, at) => fieldOf(row, book, reading, fields.length > 1 ? at + 1 : 0, doubt)),
    h("div", { class: "scene-line" },
      h("button", { type: "button", class: "scene-said", "aria-label": `Readings of ${row.label}: ${said}`, onclick: () => openReadings(row.value, book) }, items.length > 1 ? dots(items.map((each) => each.value)) : null, h("span", {}, said), spread > WIDE ? mark("warn") : null),
      can && items.length && !told?.repeats ? repeat() : null,
      told?.undo && can ? h("span", { role: "status" }, h("span", { class: "good" }, "Saved "), link("Undo", () => book.told.get(row.value) === told && take(told.undo))) : null),
    told?.same ? h("div", { class: "scene-line", role: "status" }, "The same as now", repeat(told.same)) : null,
    told?.waits ? h("div", { class: "scene-line", role: "status" }, `${told.waits} waits for a connection`) : null,
    before && !told?.undo && !told?.same && !told?.waits ? h("div", { class: "scene-line" }, h("span", {}, "was ", h("s", {}, entered(before))), can ? link("Put back", () => book.putBack(before)) : null) : null,
    told?.theirs ? conflict(row.value, book, told, items.at(-1)) : doubt ? doubted(book, doubt, items) : null,
  ];
}

function fieldOf(row, book, reading, place, doubt) {
  const unit = reading?.entered_unit ?? book.unit;
  const told = book.told.get(row.value);
  const text = told?.waits && told.of === reading?.id ? told.waits : reading ? number(reading.entered_value, DIGITS) : "";
  const label = `Luminance of ${row.label} in ${written(unit)}${place > 1 ? `, reading ${place}` : ""}`;
  const input = may("calibrate")
    ? decimal({ class: doubt ? "bad" : reading || place ? "" : "due", value: text, placeholder: "0.00", "aria-label": label, "data-reading": row.value })
    : h("output", {}, reading ? text : "–");
  let seen = reading ?? (place ? undefined : null);
  const store = async () => (seen = (await book.put(row.value, input.value, seen)) ?? seen);
  input.addEventListener("change", () => act(input, () => book.inTurn(store)));
  const meter = book.meters.find((each) => each.id === (reading ?? book).meter_id);
  return h("div", { class: "reading-row" }, place ? h("span", { class: "small muted" }, place) : null, input, h("span", { class: "unit" }, written(unit)), h("span", { class: "small muted nowrap" }, [meter?.model, reading?.taken_at?.slice(11, 16)].filter(Boolean).join(", ")));
}

const note = (kind, said, ...buttons) => h("div", { class: `scene-note ${kind}`, role: "alert" }, h("p", {}, said), h("p", { class: "scene-line" }, buttons));
const button = (text, action) => small(text, (event) => act(event.target, action));

function conflict(scene, book, { mine, theirs }, standing) {
  const put = (seen) => () => book.put(scene, mine, seen);
  return note("warn", [h("strong", {}, typeset(theirs)), " Keep yours or theirs?"], button(`Yours: ${mine}`, put(standing ?? null)), button(standing ? `Theirs: ${number(standing.entered_value, DIGITS)}` : "Theirs: none", () => book.tell(scene)), standing ? button("Both", put(undefined)) : null);
}

/** What the frames of a scene say against its reading; only the digits that were typed are ever offered. */
function doubted(book, { reading, frames }, items) {
  const wrong = items.find((each) => Math.abs(each.value / reading - 1) < 1e-9);
  const moved = wrong && wrong.entered_value * 10 ** Math.round(Math.log10(frames / reading));
  const fits = wrong && moved !== wrong.entered_value && Math.abs(Math.log2((moved / wrong.entered_value) * (reading / frames))) < 1;
  const [text, entered] = [number(moved, 6), number(wrong?.entered_value, DIGITS)];
  const keep = () => ask({ title: `Keep ${entered} ${written(wrong.entered_unit)}`, fields: [{ name: "reason", label: "Why is the reading right?", type: "textarea", of: "NewReading" }], submit: "Keep it", action: ({ reason }) => book.put(wrong.scene, String(wrong.entered_value), wrong, reason) });
  return note("bad", [h("strong", {}, `Its frames say ${number(frames, 2)} cd/m²: ${number(Math.max(frames / reading, reading / frames), 2)} times ${frames > reading ? "more" : "less"}.`), " ", h("span", { class: "tag warn" }, "needed")], fits && may("calibrate") ? button(`Move point: ${text}`, () => book.put(wrong.scene, text, wrong)) : null, wrong && may("calibrate") ? button(`Keep ${entered}…`, keep) : null);
}

function dots(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const at = (value) => (high > low ? 5 + (64 * (value - low)) / (high - low) : 37);
  return svg("svg", { class: "dots", viewBox: "0 0 74 14", "aria-hidden": "true" }, svg("path", { d: "M2 7h70" }), ...values.map((value) => svg("circle", { cx: at(value), cy: 7, r: 3 })));
}

function openReadings(scene, book) {
  const list = h("div");
  const draw = () => fill(list, rowsOf(book, book.of(scene)));
  const dialog = h("dialog", { "aria-labelledby": "readings-of", onclose: () => book.removeEventListener("change", draw) }, h("h2", { id: "readings-of" }, `Readings of ${scene}`), list, h("div", { class: "actions" }, h("button", { type: "button", onclick: () => dialog.close() }, "Close")));
  book.addEventListener("change", draw);
  draw();
  openDialog(dialog);
}

function rowsOf(book, readings) {
  if (!readings.length) return h("p", { class: "muted" }, "No reading yet.");
  const back = async (each) => {
    await book.restore(each);
    toast("Restored.");
  };
  const out = async (each) => {
    await book.withdraw(each);
    done(`Reading of ${each.scene} withdrawn.`, () => book.restore(each));
  };
  const entered = (each) => `${number(each.entered_value, DIGITS)} ${written(each.entered_unit)}`;
  const below = (each) => [each.entered_unit === each.unit ? null : `${number(each.value, 5)} ${written(each.unit)}`, each.reason && `Kept: ${each.reason}`].filter(Boolean).map((text) => h("span", { class: "sub" }, text));
  const isReplaced = (each) => each.withdrawn_at && readings.some((other) => other.created_at === each.withdrawn_at);
  const columns = [
    { head: "Reading", header: true, cell: (each) => [entered(each), ...below(each)] },
    { head: "Meter", class: "wide-only", cell: (each) => nameOfMeter(book.meters.find((meter) => meter.id === each.meter_id)) ?? "–" },
    { head: "Taken", class: "wide-only", cell: (each) => (each.taken_at ? time(each.taken_at) : "–") },
    { head: "Recorded", class: "wide-only", cell: (each) => [time(each.created_at), each.withdrawn_at ? h("span", { class: "sub" }, isReplaced(each) ? "replaced" : "withdrawn") : null] },
    ...(may("calibrate") ? [{ head: h("span", { class: "hidden" }, "Change"), cell: (each) => h("button", { type: "button", class: "quiet", "aria-label": `${each.withdrawn_at ? "Restore" : "Withdraw"} ${entered(each)} of ${each.scene}`, onclick: (event) => act(event.target, () => (each.withdrawn_at ? back(each) : out(each))) }, each.withdrawn_at ? "Restore" : "Withdraw") }] : []),
  ];
  return table(columns, readings, { caption: "Readings", row: (each) => ({ class: each.withdrawn_at ? "withdrawn" : "" }) });
}

/** The mark of a frame and its words: those of its verdict, unless it was left out. */
const standingOf = (frame) => (frame.withdrawn ? ["out", "Withdrawn"] : frame.left_out !== null ? ["out", "Left out"] : OUTCOMES[frame.outcome]);
export const kindOf = (frame) => standingOf(frame)[0];
export const sayState = (frame) => standingOf(frame)[1];

const sayExposure = (frame) => (frame.exposure_time_s ? `${exposureTime(frame.exposure_time_s)}, f/${number(frame.f_number, 3)}, ISO ${frame.iso}` : "no exposure");

const thumbnail = (frame) =>
  frame.thumbnail
    ? h("img", { class: "picture", ...imageOf(frame), alt: "", decoding: "async", width: 60, height: 45, draggable: "false" })
    : h("span", { class: "picture" }, mark(frame.state === "refused" ? "bad" : "wait"));

const lookOf = (frame) => [frame.id, frame.state, frame.outcome, frame.code, frame.left_out, frame.withdrawn, frame.signal_dn, frame.exposure_time_s, frame.scene, frame.thumbnail];

const hidden = (text) => h("span", { class: "hidden" }, text);

export function frameCell(frame, { place, chosen, compact }) {
  const kind = kindOf(frame);
  const why = ["warn", "bad"].includes(kind) && frame.code ? stateWords(frame.code) : kind === "out" ? sayState(frame).toLowerCase() : frame.state === "received" ? "received" : "";
  return h("button", { type: "button", class: `cell ${kind}${chosen ? " chosen" : ""}`, tabindex: "-1", draggable: "true", "data-id": frame.id, title: frame.detail ?? frame.filename },
    hidden(`${frame.filename}: ${[place, place && !compact ? "" : sayExposure(frame), sayState(frame).toLowerCase(), chosen ? "selected" : ""].filter(Boolean).join(", ")}, `),
    thumbnail(frame),
    h("span", { class: "pv" }, mark(kind)),
    compact ? null : h("span", { class: "says" }, h("b", {}, frame.exposure_time_s ? exposureTime(frame.exposure_time_s) : frame.filename), frame.signal_dn === null ? null : `${number(frame.signal_dn, 4)} DN`, why ? h("em", {}, why) : null),
  );
}

function gapCell(gap, { place, compact }) {
  const how = typeset([gap.exposure_time_s && (gap.exposure_time_s < 0.3 ? `1/${Number((1 / gap.exposure_time_s).toPrecision(2))} s` : `${Number(gap.exposure_time_s.toPrecision(2))} s`), gap.text].filter(Boolean).join(": "));
  return h("button", { type: "button", class: "cell-gap", tabindex: "-1", title: how },
    compact ? [h("b", { "aria-hidden": "true" }, "+"), hidden(`To photograph ${how}`)] : [h("b", {}, "To photograph"), " ", h("span", {}, how)],
    place ? hidden(`(${place})`) : null,
  );
}

/** The repeats of a cell that are not shown each, with their count; and the way back. */
function pileCell({ key, more, toCheck }, { place }) {
  const said = more ? `${number(more, 6)} more` : "Show fewer";
  const check = toCheck ? `${number(toCheck, 6)} to check` : "";
  return h("button", { type: "button", class: "cell-pile", tabindex: "-1", "data-pile": key, "aria-expanded": String(!more) },
    h("b", {}, said),
    check ? h("span", {}, mark("warn"), " ", check) : null,
    place ? hidden(`(${place})`) : null,
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
    const typing = element.firstChild.contains(document.activeElement) && document.activeElement.matches("input") ? document.activeElement : null;
    if (row.head !== headMark && typing?.value === typing?.defaultValue) {
      row.head = headMark;
      fill(element.firstChild, line.first ? headOf(line.row) : h("span", { class: "hidden" }, line.row.label));
      // selected: what is typed next takes the place of the new value
      if (typing?.matches("[data-reading]")) element.firstChild.querySelector("[data-reading]")?.select();
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
    const menu = row.frames.length && may("calibrate") ? h("button", { type: "button", class: "menu-dots", "aria-label": `Select the frames of ${row.label}`, title: "Select these frames", onclick: () => choose(row.frames.map((frame) => frame.id)) }) : null;
    if (reads && row.kind === "role" && row.value !== null && method.grid.rows === "scene") return sceneHead(row, book, { menu });
    return h("div", { class: "scene-name" }, h("span", {}, row.label), menu);
  }

  return { reads, isCompact, heightOf, drawHead, rowOf };
}

/** What somebody types is not taken from under their hands. */
