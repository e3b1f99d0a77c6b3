// Readings from a spreadsheet, held against their frames before anything is stored.

import { ask } from "../ask.js";
import { fill, h, mark, table } from "../dom.js";
import { number } from "../format.js";
import { groupBy } from "../groups.js";
import { wrong } from "../states.js";
import { written } from "./book.js";
import { about, choices, field } from "./forms.js";
import { readSheet } from "./sheet.js";

/** A reading agrees with its frames within this ratio; fewer are no column that could be a row off. */
const [LIKE, FEWEST] = [1.25, 3];
const WAYS = new Map([["0", "As pasted"], ["closed", "Blank rows left out"], ["-1", "One row up"], ["1", "One row down"]]);
const median = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];

/** What the frames of each scene say of its luminance, in a unit of their own: signal above dark per t S / f². */
function readLight(frames) {
  const used = frames.filter((frame) => frame.signal_dn !== null && frame.exposure_time_s && frame.left_out === null && frame.outcome !== "fail");
  const dark = groupBy(used.filter((frame) => frame.role === "dark"), (frame) => frame.iso);
  const light = (frame) => ((frame.signal_dn - median(dark.get(frame.iso).map((each) => each.signal_dn))) * frame.f_number ** 2) / (frame.exposure_time_s * frame.iso);
  const lit = groupBy(used.filter((frame) => frame.scene && dark.has(frame.iso)), (frame) => frame.scene);
  return new Map([...lit].map(([scene, some]) => [scene, median(some.map(light))]));
}

/** A column of values is given to the scenes from `from` on; lines that name their scene are taken as they are. */
export function openPaste(book, scenes, { text = "", from = scenes[0] }) {
  const lines = h("textarea", { rows: "7", class: "mono", spellcheck: "false", placeholder: "Scene 1\t54.4\nScene 2\t23.1" }, text);
  const shown = h("div", { class: "preview-lines" });
  const light = readLight(book.state.frames);
  const begin = scenes.indexOf(from);
  const standing = (scene) => book.of(scene).filter((each) => !each.withdrawn_at);
  let [shift, read] = [null, { rows: [], faults: [] }];

  /** {rows, faults, agreeing, usual}: of each row its reading, and whether its frames agree; null where they say nothing. */
  function judge({ rows, faults }) {
    const ratios = rows.map(({ reading }) => light.has(reading.scene) && reading.value / light.get(reading.scene));
    const usual = median(ratios.filter(Boolean));
    const told = rows.map(({ reading }, at) => ({ ...reading, agrees: ratios[at] && ratios.filter(Boolean).length >= FEWEST ? Math.abs(Math.log(ratios[at] / usual)) < Math.log(LIKE) : null }));
    return { rows: told, faults, usual, agreeing: told.filter(({ agrees }) => agrees).length };
  }

  function draw() {
    const cells = lines.value.trimEnd().split(/\r\n|\r|\n/);
    // a column may have a heading
    const head = cells.length > 1 && /^[^\t\d][^\t]*\D$/.test(cells[0]) ? 1 : 0;
    const isColumn = cells.slice(head).every((cell) => /^\s*([\d.,+−-][^\t]*)?$/.test(cell));
    const blanks = (upTo) => cells.slice(0, upTo).filter((cell) => !cell.trim()).length;
    const lined = (by) => cells.map((cell, at) => (at < head ? `scene\tvalue ${/[[(].*/.exec(cell) ?? ""}` : cell.trim() && `${scenes[begin + at - head + (by === "closed" ? -blanks(at) : Number(by))] ?? ""}\t${cell}`)).join("\n");
    const judged = (text, headless) => judge(readSheet(text, { unit: book.unit, headless, scenes }));
    const ways = isColumn ? [...WAYS.keys()].filter((by) => by !== "closed" || blanks()).map((by) => ({ by, ...judged(lined(by), !head) })) : [{ by: "0", ...judged(lines.value) }];
    const best = ways.reduce((one, other) => (other.agreeing > one.agreeing && other.agreeing >= FEWEST ? other : one));
    read = ways.find(({ by }) => by === (shift ?? best.by));
    const first = ({ by }) => scenes[begin + (Number(by) || 0)];
    const told = ({ scene, agrees }) => (!book.state.scenes.includes(scene) ? [mark("warn"), ` no frames of ${scene}`] : agrees === null ? "" : agrees ? [mark("good"), " agrees"] : [mark("bad"), " differs"]);
    fill(shown,
      read.faults.length ? h("ul", { class: "plain faults", role: "alert" }, read.faults.slice(0, 8).map((fault) => h("li", {}, h("strong", {}, `Line ${fault.line}: `), fault.text))) : null,
      best !== ways[0] ? [h("p", {}, h("strong", {}, `They fit the frames from ${first(best)}.`), " Nothing is stored yet."), choices("shift", [ways[0], best].map((way) => [way.by, `${WAYS.get(way.by)}, from ${first(way)}`, `${way.agreeing} of ${cells.length - head - blanks()} agree`]), (by) => ((shift = by), draw()), read.by)] : null,
      read.rows.length ? table([
        { head: "Scene", header: true, cell: ({ scene }) => scene },
        { head: "Frames say", class: "number", cell: ({ scene }) => (light.has(scene) && read.usual ? number(read.usual * light.get(scene), 2) : "–") },
        { head: "Reading", class: "number", cell: ({ value, unit }) => `${number(value, 15)} ${written(unit)}` },
        { head: h("span", { class: "hidden" }, "Verdict"), cell: told },
      ], read.rows, { caption: "Readings to store" }) : null);
  }

  async function store() {
    if (read.faults.length) throw wrong(read.faults.map((fault) => `Line ${fault.line}: ${fault.text}`).join(" "));
    const fresh = read.rows.filter(({ scene, value, unit }) => !standing(scene).some((each) => each.entered_value === value && each.entered_unit === unit));
    if (!fresh.length) throw wrong(read.rows.length ? "These readings are there already." : "Paste a line such as: Scene 1 54.4");
    const taken = new Set();
    await book.recordAll(fresh.map(({ agrees, ...row }) => {
      const reading = book.withMeter(row);
      const here = standing(row.scene).filter((each) => each.quantity === reading.quantity);
      // a value takes the place of the one reading that is there; others are repeats
      const isRepeat = taken.has(row.scene) || here.length > 1;
      taken.add(row.scene);
      return isRepeat ? reading : { ...reading, replaces: here[0]?.id ?? "" };
    }));
  }

  lines.addEventListener("input", () => ((shift = null), draw()));
  draw();
  const hint = "One value per line, or scene, value, and optionally unit and time (UTC), from a spreadsheet. Unit and meter are those chosen above the grid where a line states none.";
  return ask({ title: "Paste readings", body: [field("Lines", lines, hint, about("NewReading", "value")), shown], submit: "Store", action: store });
}
