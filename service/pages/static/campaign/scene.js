// The head of a scene's row: each of its readings is a field of its own; what was typed last is told beside it.

import { small } from "../causes.js";
import { done, fill, h, mark, may, openDialog, svg, table, take, toast } from "../dom.js";
import { counted, number, percent, time, typeset } from "../format.js";
import { act } from "../states.js";
import { written } from "./book.js";
import { decimal } from "./forms.js";
import { nameOfMeter } from "./meters.js";
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

export function extraHeight(book, scene) {
  const { fields, told, before, doubt } = look(book, scene);
  const second = told?.undo ? fields.length > 1 : told?.same || before;
  return (fields.length - 1) * HEIGHTS.reading + (second ? HEIGHTS.line : 0) + (told?.theirs || doubt ? HEIGHTS.note : 0);
}

/** What changes the look of a scene's head. */
export const lookOfHead = (book, scene) => [book.of(scene), book.told.get(scene), book.doubtOf(scene), book.unit, book.meter_id, book.meters.length];

export function sceneHead(row, book, { menu }) {
  const { items, others, mean, spread, unit, told, fields, before, doubt } = look(book, row.value);
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
    before && !told?.undo && !told?.same ? h("div", { class: "scene-line" }, h("span", {}, "was ", h("s", {}, entered(before))), can ? link("Put back", () => book.putBack(before)) : null) : null,
    told?.theirs ? conflict(row.value, book, told, items.at(-1)) : doubt ? doubted(book, doubt, items) : null,
  ];
}

function fieldOf(row, book, reading, place, doubt) {
  const unit = reading?.entered_unit ?? book.unit;
  const text = reading ? number(reading.entered_value, DIGITS) : "";
  const label = `Luminance of ${row.label} in ${written(unit)}${place > 1 ? `, reading ${place}` : ""}`;
  const input = may("calibrate")
    ? decimal({ class: doubt ? "bad" : reading || place ? "" : "due", value: text, placeholder: "0.00", "aria-label": label, "data-reading": row.value })
    : h("output", {}, reading ? text : "–");
  let seen = reading ?? (place ? undefined : null);
  const store = async () => (seen = (await book.put(row.value, input.value, seen)) ?? seen);
  input.addEventListener("change", () => act(input, () => book.inTurn(store)));
  const meter = nameOfMeter(book.meters.find((each) => each.id === (reading ?? book).meter_id));
  return h("div", { class: "reading-row" }, place ? h("span", { class: "small muted" }, place) : null, input, h("span", { class: "unit" }, written(unit)), h("span", { class: "small muted nowrap" }, [meter?.split(" ").slice(1, -1).join(" "), reading?.taken_at?.slice(11, 16)].filter(Boolean).join(", ")));
}

const note = (kind, said, ...buttons) => h("div", { class: `scene-note ${kind}`, role: "alert" }, h("p", {}, said), h("p", { class: "scene-line" }, buttons));
const button = (text, action) => small(text, (event) => act(event.target, action));

/** Another user was faster: both values are offered. */
function conflict(scene, book, { mine, theirs }, standing) {
  const put = (seen) => () => book.put(scene, mine, seen);
  return note("warn", [h("strong", {}, typeset(theirs)), " Keep yours or theirs?"], button(`Yours: ${mine}`, put(standing ?? null)), button(standing ? `Theirs: ${number(standing.entered_value, DIGITS)}` : "Theirs: none", () => book.tell(scene)), standing ? button("Both", put(undefined)) : null);
}

/** What the frames of a scene say against its reading; only the digits that were typed are ever offered. */
function doubted(book, { reading, frames }, items) {
  const wrong = items.find((each) => Math.abs(each.value / reading - 1) < 1e-9);
  const moved = wrong && wrong.entered_value * 10 ** Math.round(Math.log10(frames / reading));
  const fits = wrong && moved !== wrong.entered_value && Math.abs(Math.log2((moved / wrong.entered_value) * (reading / frames))) < 1;
  const text = number(moved, 6);
  return note("bad", [h("strong", {}, `Its frames say ${number(frames, 2)} cd/m²: ${number(Math.max(frames / reading, reading / frames), 2)} times ${frames > reading ? "more" : "less"}.`), " ", h("span", { class: "tag warn" }, "needed")], fits && may("calibrate") ? button(`Move point: ${text}`, () => book.put(wrong.scene, text, wrong)) : null);
}

function dots(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const at = (value) => (high > low ? 5 + (64 * (value - low)) / (high - low) : 37);
  return svg("svg", { class: "dots", viewBox: "0 0 74 14", "aria-hidden": "true" }, svg("path", { d: "M2 7h70" }), ...values.map((value) => svg("circle", { cx: at(value), cy: 7, r: 3 })));
}

/** All readings of a scene in a dialog, withdrawn ones too. */
function openReadings(scene, book) {
  const list = h("div");
  const draw = () => fill(list, rowsOf(book, book.of(scene)));
  const dialog = h("dialog", { "aria-labelledby": "readings-of", onclose: () => book.removeEventListener("change", draw) }, h("h2", { id: "readings-of" }, `Readings of ${scene}`), list, h("div", { class: "actions" }, h("button", { type: "button", onclick: () => dialog.close() }, "Close")));
  book.addEventListener("change", draw);
  draw();
  openDialog(dialog);
}

/** Readings as a table, each with its way out and back. */
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
  const isReplaced = (each) => each.withdrawn_at && readings.some((other) => other.created_at === each.withdrawn_at);
  const columns = [
    { head: "Reading", header: true, cell: (each) => [entered(each), each.entered_unit === each.unit ? null : h("span", { class: "sub" }, `${number(each.value, 5)} ${written(each.unit)}`)] },
    { head: "Meter", class: "wide-only", cell: (each) => nameOfMeter(book.meters.find((meter) => meter.id === each.meter_id)) ?? "–" },
    { head: "Taken", class: "wide-only", cell: (each) => (each.taken_at ? time(each.taken_at) : "–") },
    { head: "Recorded", class: "wide-only", cell: (each) => [time(each.created_at), each.withdrawn_at ? h("span", { class: "sub" }, isReplaced(each) ? "replaced" : "withdrawn") : null] },
    ...(may("calibrate") ? [{ head: h("span", { class: "hidden" }, "Change"), cell: (each) => h("button", { type: "button", class: "quiet", "aria-label": `${each.withdrawn_at ? "Restore" : "Withdraw"} ${entered(each)} of ${each.scene}`, onclick: (event) => act(event.target, () => (each.withdrawn_at ? back(each) : out(each))) }, each.withdrawn_at ? "Restore" : "Withdraw") }] : []),
  ];
  return table(columns, readings, { caption: "Readings", row: (each) => ({ class: each.withdrawn_at ? "withdrawn" : "" }) });
}
