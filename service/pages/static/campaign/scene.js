// The head of a scene's row: its reading is typed in place, all its readings and their spread stand beside it.

import { post, send } from "../api.js";
import { fill, h, may, openDialog, svg, table, toast } from "../dom.js";
import { counted, number, percent, time } from "../format.js";
import { inOrder } from "../groups.js";
import { Turns } from "../live.js";
import { mark } from "../marks.js";
import { done } from "../undo.js";
import { act } from "../states.js";
import { about, decimal, field, select } from "./forms.js";
import { nameOfMeter } from "./meters.js";
import { wrong } from "./numbers.js";
import { UNITS, readReading, readSheet } from "./sheet.js";

/** Readings of one scene that differ by more than this are marked. */
const WIDE = 0.03;

export const written = (unit) => unit.replace("m2", "m²");

/** The luminance readings of a scene that count: {value, unit, spread, items}; in the unit in which all were entered. */
export function summarise(readings, scene) {
  const here = readings.filter((each) => each.scene === scene && !each.withdrawn_at);
  const items = here.filter((each) => each.quantity === UNITS["cd/m2"]);
  const unit = items.every((each) => each.entered_unit === items[0].entered_unit) ? items[0]?.entered_unit : items[0].unit;
  const values = items.map((each) => (each.entered_unit === unit ? each.entered_value : each.value));
  const value = values.length ? values.reduce((sum, each) => sum + each, 0) / values.length : null;
  return { value, unit, items, others: here.length - items.length, spread: values.length > 1 ? (Math.max(...values) - Math.min(...values)) / value : null };
}

function dots(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const at = (value) => (high > low ? 5 + (64 * (value - low)) / (high - low) : 37);
  return svg("svg", { class: "dots", viewBox: "0 0 74 14", "aria-hidden": "true" }, svg("path", { d: "M2 7h70" }), ...values.map((value) => svg("circle", { cx: at(value), cy: 7, r: 3 })));
}

/** {parts, save}: the row's head; `book` knows readings, meters and what a typed value is given. */
export function sceneHead(row, book, { menu }) {
  const { value, items, others, spread, unit = book.unit } = summarise(book.readings, row.value);
  const last = items.at(-1);
  const input = may("calibrate")
    ? decimal({ class: items.length ? "" : "due", value: value === null ? "" : number(value, 4), placeholder: "0.00", "aria-label": `Luminance of ${row.label} in ${written(unit)}`, "data-reading": row.value })
    : h("output", {}, value === null ? "–" : number(value, 4));
  input.addEventListener("change", () => act(input, () => book.add(row.value, input)));
  const meter = nameOfMeter(book.meters.find((each) => each.id === (last ?? book).meter_id));
  const said = items.length === 0 ? (others ? counted(others, "illuminance reading") : "No reading yet") : items.length === 1 ? "1 reading, spread unknown" : `${items.length} readings, spread ${percent(spread)}`;
  return [
    h("div", { class: "scene-name" }, h("span", {}, row.label), menu),
    h("div", { class: "reading-row" }, input, h("span", { class: "unit" }, written(unit)), h("span", { class: "small muted nowrap" }, [meter?.split(" ").slice(1, -1).join(" "), last?.taken_at?.slice(11, 16)].filter(Boolean).join(", "))),
    h("button", { type: "button", class: "scene-said", "aria-label": `Readings of ${row.label}: ${said}`, onclick: () => openReadings(row.value, book) }, items.length ? dots(items.map((each) => each.value)) : null, h("span", {}, said), spread > WIDE ? mark("warn") : null),
  ];
}

/** What readings of a campaign there are, and how a typed one is recorded. */
export class ReadingBook extends EventTarget {
  constructor(state) {
    super();
    Object.assign(this, { state, readings: [], meters: [], unit: "cd/m2", meter_id: "", now: false, turns: new Turns() });
  }

  /** These are the organisation's meters. */
  meet(meters) {
    this.meters = inOrder(meters, nameOfMeter);
    const ofKind = meters.filter((each) => each.kind === UNITS[this.unit]);
    // of several of a kind nobody but the reader of the meter knows which it was
    this.meter_id ||= ofKind.length === 1 ? ofKind[0].id : "";
    if (!this.state.left) this.dispatchEvent(new Event("change"));
  }

  async refresh() {
    const turn = this.turns.ask();
    const readings = await this.state.readings();
    if (this.turns.take(turn)) this.readings = readings;
    if (!this.state.left) this.dispatchEvent(new Event("change"));
  }

  async add(scene, input, said = {}) {
    const typed = input.value.trim();
    const known = summarise(this.readings, scene);
    if (typed === "" || (!said.unit && known.value !== null && typed === number(known.value, 4))) return null;
    return this.record([this.withMeter({ scene, ...readReading(typed, said.unit ?? known.unit ?? this.unit) }, said)]);
  }

  /** A column of a spreadsheet, from a scene on; of several columns each line names its scene. */
  pasted(text, scenes) {
    if (text.includes("\t")) {
      const { rows, faults } = readSheet(text, this);
      if (faults.length) throw wrong(`Nothing was recorded. Line ${faults[0].line}: ${faults[0].text}`);
      return this.record(rows.map(({ reading }) => this.withMeter(reading)));
    }
    const lines = text.trimEnd().split(/\r\n|\r|\n/);
    if (lines.length > scenes.length) throw wrong(`Nothing was recorded: ${lines.length} values were pasted, and ${counted(scenes.length, "scene")} begin here.`);
    return this.record(lines.map((line, at) => line.trim() && this.withMeter({ scene: scenes[at], ...readReading(line, this.unit) })).filter(Boolean));
  }

  withMeter({ scene, value, unit, ...more }, { meter_id: meter = more.meter_id ?? this.meter_id, taken_at: taken = more.taken_at ?? (this.now ? new Date().toISOString() : "") } = {}) {
    const fits = this.meters.find((each) => each.id === meter)?.kind === UNITS[unit];
    return { scene, quantity: UNITS[unit], value, unit, ...(meter && fits ? { meter_id: meter } : {}), ...(taken ? { taken_at: taken } : {}) };
  }

  /** Record readings together; they are withdrawn together, too. */
  async record(readings, query = "") {
    const { items } = await post(`${this.state.path}/readings${query}`, readings);
    await this.refresh();
    this.state.touch();
    const [{ scene, entered_value: value, entered_unit: unit }] = items;
    done(items.length === 1 ? `${number(value, 6)} ${written(unit)} recorded for ${scene}.` : `${counted(items.length, "reading")} recorded.`, async () => {
      for (const each of items) await this.withdraw(each);
    });
    return items;
  }

  async withdraw(reading) {
    await send("DELETE", `/v1/readings/${reading.id}`);
    await this.refresh();
    this.state.touch();
  }

  async restore(reading) {
    await post(`/v1/readings/${reading.id}/restore`);
    await this.refresh();
    this.state.touch();
  }
}

/** All readings of a scene in a dialog, withdrawn ones too. */
function openReadings(scene, book) {
  const list = h("div");
  const value = decimal({});
  const unit = select(Object.keys(UNITS).map((name) => [name, written(name)]), {}, book.unit);
  const meter = select([["", "Not recorded"], ...book.meters.map((each) => [each.id, nameOfMeter(each)])], {}, book.meter_id);
  const taken = h("input", { type: "datetime-local" });
  const draw = () => fill(list, rowsOf(book, book.readings.filter((each) => each.scene === scene)));
  const add = () => book.add(scene, value, { unit: unit.value, meter_id: meter.value, taken_at: taken.value ? `${taken.value}:00Z` : "" }).then((made) => made && (value.value = ""));
  const form = may("calibrate")
    ? h("form", { onsubmit: (event) => (event.preventDefault(), act(event.submitter, add)) }, h("div", { class: "fields" }, field("Value", value, null, about("NewReading", "value")), field("Unit", unit, null, about("NewReading", "unit")), field("Meter", meter, null, about("NewReading", "meter_id")), field("Time (UTC)", taken, null, about("NewReading", "taken_at"))), h("div", { class: "actions" }, h("button", { type: "button", onclick: () => dialog.close() }, "Close"), h("button", { class: "primary", type: "submit" }, "Add reading")))
    : null;
  const dialog = h("dialog", { "aria-labelledby": "readings-of", onclose: () => book.removeEventListener("change", draw) }, h("h2", { id: "readings-of" }, `Readings of ${scene}`), list, form);
  book.addEventListener("change", draw);
  draw();
  openDialog(dialog);
}

/** Readings as a table, each with its way out and back. */
export function rowsOf(book, readings) {
  if (!readings.length) return h("p", { class: "muted" }, "No reading yet.");
  const back = async (each) => {
    await book.restore(each);
    toast("Restored.");
  };
  const out = async (each) => {
    await book.withdraw(each);
    done(`Reading of ${each.scene} withdrawn.`, () => book.restore(each));
  };
  const entered = (each) => `${number(each.entered_value, 6)} ${written(each.entered_unit)}`;
  const columns = [
    { head: "Reading", header: true, cell: (each) => [`${number(each.value, 5)} ${written(each.unit)}`, each.entered_unit === each.unit ? null : h("span", { class: "sub" }, entered(each))] },
    { head: "Meter", class: "wide-only", cell: (each) => nameOfMeter(book.meters.find((meter) => meter.id === each.meter_id)) ?? "–" },
    { head: "Taken", class: "wide-only", cell: (each) => (each.taken_at ? time(each.taken_at) : "–") },
    ...(may("calibrate") ? [{ head: h("span", { class: "hidden" }, "Change"), cell: (each) => h("button", { type: "button", class: "quiet", "aria-label": `${each.withdrawn_at ? "Restore" : "Withdraw"} ${entered(each)} of ${each.scene}`, onclick: (event) => act(event.target, () => (each.withdrawn_at ? back(each) : out(each))) }, each.withdrawn_at ? "Restore" : "Withdraw") }] : []),
  ];
  return table(columns, readings, { caption: "Readings", row: (each) => ({ class: each.withdrawn_at ? "withdrawn" : "" }) });
}

/** How the values that are typed in the grid were read. */
export function readingTools(book, registerMeter) {
  const unit = select(Object.keys(UNITS).map((name) => [name, written(name)]), { "aria-label": "Unit of typed readings", title: about("NewReading", "unit"), onchange: () => ((book.unit = unit.value), book.dispatchEvent(new Event("change"))) }, book.unit);
  const meter = h("select", { "aria-label": "Meter of typed readings", title: about("NewReading", "meter_id"), onchange: async () => {
    if (meter.value === "new") await registerMeter();
    else book.meter_id = meter.value;
    draw();
  } });
  const when = select([["", "time not recorded"], ["now", "read now"]], { "aria-label": "Time of typed readings", title: about("NewReading", "taken_at"), onchange: () => (book.now = when.value === "now") });
  const draw = () => fill(meter, [["", "meter not recorded"], ...book.meters.map((each) => [each.id, nameOfMeter(each)]), ["new", "Register a meter…"]].map(([value, text]) => h("option", { value, selected: value === book.meter_id }, text)));
  book.addEventListener("change", draw);
  draw();
  return h("p", { class: "reading-tools small" }, h("span", {}, "Typed readings:"), unit, meter, when);
}
