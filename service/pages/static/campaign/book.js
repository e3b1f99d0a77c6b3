// The readings of a campaign, the organisation's meters, and how a typed value is recorded.

import { OFFLINE, newOnce, post, send } from "../api.js";
import { act, askLast, done, fill, h, remember } from "../dom.js";
import { counted, groupBy, inOrder } from "../format.js";
import { about, optionsOf, select } from "../ask.js";
import { nameOfMeter } from "./target.js";
import { UNITS, readReading } from "./sheet.js";

export const written = (unit) => unit.replace("m2", "m²");

const RETRY_MS = 5000;
const connection = () => new Promise((done) => {
  addEventListener("online", done, { once: true });
  setTimeout(done, RETRY_MS);
});

/** A reading to be recorded again: what it does not state is null, and is not taken from what is chosen for typed ones. */
const again = ({ scene, entered_value: value, entered_unit: unit, meter_id = null, taken_at = null, reason }) => ({ scene, value, unit, meter_id, taken_at, reason });

export class ReadingBook extends EventTarget {
  constructor(state) {
    super();
    Object.assign(this, { state, readings: [], byScene: new Map(), meters: [], unit: "cd/m2", meter_id: "", now: false, turn: Promise.resolve() });
    /** By scene, what was typed last: {undo}, {same}, {waits, of}, {repeats} or {mine, theirs}. */
    this.told = new Map();
  }

  of(scene) {
    return this.byScene.get(scene) ?? [];
  }

  /** The reading of a scene that its frames speak against: {reading, frames} in cd/m². */
  doubtOf(scene) {
    const { subjects, values } = this.state.campaign?.causes.find(({ code, severity }) => code === "reading_off" && severity === "error") ?? { subjects: [] };
    const at = subjects.indexOf(`scene ${scene}`);
    return at < 0 ? null : { reading: values.reading_cd_m2[at], frames: values.frames_cd_m2[at] };
  }

  draw() {
    if (!this.state.left) this.dispatchEvent(new Event("change"));
  }

  tell(scene, said) {
    if (said) this.told.set(scene, said);
    else this.told.delete(scene);
    this.draw();
  }

  meet(meters) {
    this.meters = inOrder(meters, nameOfMeter);
    const ofKind = meters.filter((each) => each.kind === UNITS[this.unit]);
    // of several of a kind nobody but the reader of the meter knows which it was
    this.meter_id ||= ofKind.length === 1 ? ofKind[0].id : "";
    this.draw();
  }

  async refresh() {
    const isLast = askLast(this);
    const readings = await this.state.readings();
    if (isLast()) Object.assign(this, { readings, byScene: groupBy(readings, (each) => each.scene) });
    this.draw();
  }

  /** What is typed in one field while an earlier value of it is on its way waits for that. */
  inTurn(work) {
    this.turn = this.turn.then(work, work);
    return this.turn;
  }

  /**
   * What was typed takes the place of the reading that was `seen` in its field: null where there was none, undefined for a repeat.
   * Answers what was recorded; of a value that another user has changed meanwhile both are shown, and without a connection it waits for one. With a `reason` it is kept against its frames.
   */
  async put(scene, typed, seen, reason) {
    const text = typed.trim();
    if (text === "") return null;
    const read = readReading(text, seen?.entered_unit ?? this.unit);
    if (!reason && seen && read.value === seen.entered_value && read.unit === seen.entered_unit) {
      if (!this.told.get(scene)?.undo) this.tell(scene, { same: text });
      return null;
    }
    this.told.delete(scene);
    // a corrected figure was read with the same meter at the same time
    const reading = this.withMeter({ ...(seen ? again(seen) : { scene }), ...read, reason });
    const once = newOnce();
    const send = async () => {
      const [made] = await this.record([{ ...reading, ...(seen === undefined ? {} : { replaces: seen?.id ?? "" }) }], once);
      const undo = () => (seen ? this.putBack(seen, made) : this.withdraw(made));
      remember(undo);
      this.tell(scene, { undo });
      return made;
    };
    while (!this.state.left) {
      try {
        return await send();
      } catch (error) {
        if (error.code === OFFLINE.code) {
          if (!this.told.get(scene)?.waits) this.tell(scene, { waits: text, of: seen?.id });
          await connection();
          continue;
        }
        if (error.code !== "changed_meanwhile") throw error;
        await this.refresh();
        this.tell(scene, { mine: text, theirs: error.message });
        return null;
      }
    }
    return null;
  }

  /** An earlier reading takes the place of the one that had taken its own. */
  async putBack(old, made = this.of(old.scene).find((each) => each.created_at === old.withdrawn_at)) {
    await this.record([{ ...this.withMeter(again(old)), replaces: made.id }]);
  }

  withMeter({ scene, value, unit, reason, meter_id: meter = this.meter_id, taken_at: taken = this.now ? new Date().toISOString() : "" }) {
    const fits = this.meters.find((each) => each.id === meter)?.kind === UNITS[unit];
    return { scene, quantity: UNITS[unit], value, unit, ...(meter && fits ? { meter_id: meter } : {}), ...(taken ? { taken_at: taken } : {}), ...(reason ? { reason } : {}) };
  }

  async record(readings, once) {
    const { items } = await post(`${this.state.path}/readings`, readings, { once });
    for (const { scene } of readings) this.told.delete(scene);
    await this.change();
    return items;
  }

  /** Record pasted readings together; they are withdrawn together, too, and what they replaced is back. */
  async recordAll(readings) {
    const replaced = readings.map(({ replaces }) => this.readings.find((each) => each.id === replaces));
    const items = await this.record(readings);
    done(`${counted(items.length, "reading")} recorded.`, async () => {
      for (const [at, each] of items.entries()) await (replaced[at] ? this.putBack(replaced[at], each) : this.withdraw(each));
    });
  }

  /** The readings that the chosen meter may have read, and that name none. */
  get unnamed() {
    const kind = this.meters.find((each) => each.id === this.meter_id)?.kind;
    return this.readings.filter((each) => !each.withdrawn_at && !each.meter_id && each.quantity === kind);
  }

  nameMeter() {
    return this.recordAll(this.unnamed.map((each) => ({ ...this.withMeter({ ...again(each), meter_id: this.meter_id }), replaces: each.id })));
  }

  async change() {
    await this.refresh();
    this.state.touch();
  }

  async withdraw(reading) {
    await send("DELETE", `/v1/readings/${reading.id}`);
    this.told.delete(reading.scene);
    await this.change();
  }

  async restore(reading) {
    await post(`/v1/readings/${reading.id}/restore`);
    await this.change();
  }
}

export function readingTools(book, registerMeter, paste) {
  const unit = select(Object.keys(UNITS).map((name) => [name, written(name)]), { "aria-label": "Unit of typed readings", title: about("NewReading", "unit"), onchange: () => ((book.unit = unit.value), book.draw()) }, book.unit);
  const meter = h("select", { "aria-label": "Meter of typed readings", title: about("NewReading", "meter_id"), onchange: async () => {
    if (meter.value === "new") await registerMeter();
    else book.meter_id = meter.value;
    draw();
  } });
  const when = select([["", "time not recorded"], ["now", "read now"]], { "aria-label": "Time of typed readings", title: about("NewReading", "taken_at"), onchange: () => (book.now = when.value === "now") });
  const naming = h("button", { type: "button", class: "small-button", onclick: (event) => act(event.target, () => book.nameMeter()) });
  const draw = () => {
    const { length } = book.unnamed;
    naming.hidden = !length;
    naming.textContent = `Name it in ${counted(length, "reading")} without a meter`;
    fill(meter, optionsOf([["", "meter not recorded"], ...book.meters.map((each) => [each.id, nameOfMeter(each)]), ["new", "Register a meter…"]], book.meter_id));
  };
  book.addEventListener("change", draw);
  draw();
  return h("p", { class: "reading-tools small" }, h("span", {}, "Typed readings:"), unit, meter, naming, when, h("button", { type: "button", class: "small-button", onclick: paste }, "Paste readings…"));
}
