// Readings from the cells of a spreadsheet, and those that are typed and pasted in the heads of the grid's rows.

import { about, ask, choices, field, readNumber } from "../ask.js";
import { fill, h, mark, table, wrong } from "../dom.js";
import { groupBy, number } from "../format.js";
import { written } from "./book.js";

export const UNITS = { "cd/m2": "luminance", fL: "luminance", lx: "illuminance", fc: "illuminance" };
const NAMES = ["scene", "quantity", "value", "unit", "meter_id", "taken_at"];
const OTHER_COLUMNS = { luminance: "value", l: "value", reading: "value", level: "scene", time: "taken_at" };
/** A comma before three digits may be a decimal one, or one of thousands: except behind a zero. */
const AMBIGUOUS = /^[1-9]\d{0,2}(?=.*,)([.,]\d{3})+$/;
const OTHER_NAMES = { "cd/m^2": "cd/m2", nit: "cd/m2", nits: "cd/m2", lux: "lx" };
/** Written before a unit, it is a thousandth or a thousandfold. */
const PREFIX = { m: 1e-3, k: 1e3 };
const WITH_UNIT = new RegExp(`^(.*?)\\s*\\[?(?:([mk])?(${[...Object.keys(UNITS), "cd/m²", ...Object.keys(OTHER_NAMES)].map((name) => name.replace("^", "\\^")).join("|")}))?\\]?$`, "i");
const ZONED = /(Z|[+-]\d\d:?\d\d)$/i;

/** {rows: [{line, reading}], faults: [{line, text}]}; `unit` is that of lines that say none, `scenes` are those that may be meant. */
function readSheet(text, { unit, headless = false, scenes = [] }) {
  const lines = text.split(/\r\n|\r|\n/).map((line, index) => ({ line: index + 1, text: line }));
  const filled = lines.filter((each) => each.text.trim());
  const separator = separatorOf(filled);
  let columns = ["scene", "value", "unit", "taken_at"];
  // as "Luminance [cd/m²]": the unit is that of the values below it
  const heads = (filled[0] ? cellsOf(filled[0].text, separator) : []).map((cell) => /^(.*?)\s*(?:[[(](.*)[\])])?$/.exec(cell).slice(1));
  const first = heads.map(([name]) => OTHER_COLUMNS[name.toLowerCase()] ?? name.toLowerCase());
  const headed = !headless && (first.includes("scene") || first.includes("value"));
  const behind = (headed && heads[first.indexOf("value")]?.[1]) || "";
  const result = { rows: [], faults: [] };
  if (headed) {
    columns = first;
    const strange = first.filter((name) => name && !NAMES.includes(name));
    if (strange.length) result.faults.push({ line: filled[0].line, text: `unknown column “${strange[0]}”; known are ${NAMES.join(", ")}.` });
    for (const needed of ["scene", "value"]) if (!first.includes(needed)) result.faults.push({ line: filled[0].line, text: `the column ${needed} is missing.` });
    if (result.faults.length) return result;
  }
  for (const each of headed ? filled.slice(1) : filled) {
    try {
      result.rows.push({ line: each.line, reading: readLine(cellsOf(each.text, separator), { columns, usual: unit, separator, behind, scenes }) });
    } catch (fault) {
      result.faults.push({ line: each.line, text: fault.message });
    }
  }
  return result;
}

function separatorOf(lines) {
  const all = lines.map((each) => each.text).join("\n");
  if (all.includes("\t")) return "\t";
  if (all.includes(";")) return ";";
  // without either, a line is a scene and a number, apart by blanks: a comma may be a decimal one
  return " ";
}

function cellsOf(text, separator) {
  if (separator !== " ") return text.split(separator).map((cell) => cell.trim().replace(/^"(.*)"$/, "$1").trim());
  const typed = /^\s*(.*?)[\s,]+([+-]?[\d.,]+)(?:[\s,]+(cd\/m2|cd\/m²|fL|lx|fc))?\s*$/i.exec(text);
  return typed ? typed.slice(1).filter((cell) => cell !== undefined) : text.trim().split(/[\s,]+/);
}

function readLine(cells, { columns, usual, separator, behind, scenes }) {
  const said = Object.fromEntries(columns.map((name, index) => [name, cells[index] ?? ""]));
  if (cells.slice(columns.length).some(Boolean)) throw new Error(`${cells.length} cells; expected are ${columns.join(", ")}.`);
  if (!said.scene) throw new Error("there is no scene for this value.");
  if (!said.value) throw new Error("the value is missing.");
  const { value, unit } = readReading(said.unit || WITH_UNIT.exec(said.value)[3] ? said.value : `${said.value} ${behind}`, said.unit ? unitOf(said.unit) : usual, { commas: separator === ";" });
  const quantity = said.quantity ? said.quantity.toLowerCase() : UNITS[unit];
  if (quantity !== UNITS[unit]) throw new Error(`${unit} is not a unit of ${quantity}.`);
  return { scene: sceneOf(said.scene, scenes), quantity, value, unit, ...(said.meter_id ? { meter_id: said.meter_id } : {}), ...(said.taken_at ? { taken_at: instantOf(said.taken_at) } : {}) };
}

/** The one scene that may be meant: "scene 4" and "4" are Scene 4. */
function sceneOf(typed, scenes) {
  const plain = (name) => name.toLowerCase().replace(/[\s_-]/g, "");
  const meant = scenes.filter((name) => plain(name) === plain(typed) || /\d*$/.exec(name)[0] === typed);
  return scenes.includes(typed) || meant.length !== 1 ? typed : meant[0];
}

/** {value, unit} of a reading as people type it, a unit behind it or not; `commas`: a comma is known to be a decimal one. */
export function readReading(text, usual, { commas = false } = {}) {
  const [, figure, prefix, unit] = WITH_UNIT.exec(text.trim());
  if (AMBIGUOUS.test(figure) && !commas) throw wrong(`“${figure}” is ambiguous (thousands separator or decimal comma): write ${figure.replaceAll(",", "")} or ${figure.replace(",", ".")}.`);
  const value = readNumber(figure);
  if (!Number.isFinite(value)) throw wrong(`“${text.trim()}” is not a number.`);
  if (!(value > 0)) throw wrong("A reading must be above 0.");
  if (prefix && !(prefix in PREFIX)) throw wrong(`“${prefix}${unit}” is not a unit.`);
  return { value: Number((value * (PREFIX[prefix] ?? 1)).toPrecision(15)), unit: unit ? unitOf(unit) : usual };
}

function unitOf(text) {
  const plain = text.replace("²", "2").replace(/^\[|\]$/g, "").toLowerCase();
  const found = OTHER_NAMES[plain] ?? Object.keys(UNITS).find((name) => name.toLowerCase() === plain);
  if (!found) throw new Error(`“${text}” is not a unit; use ${Object.keys(UNITS).join(", ")}.`);
  return found;
}

function instantOf(text) {
  // the times of the pages are UTC, whatever zone the browser is in
  const instant = /^\d{4}-\d\d-\d\d/.test(text) ? new Date(ZONED.test(text) || text.length === 10 ? text : `${text.replace(" ", "T")}Z`) : new Date(NaN);
  if (Number.isNaN(instant.getTime())) throw new Error(`“${text}” is not a time; write it as 2026-05-01 20:30.`);
  return instant.toISOString();
}

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
function openPaste(book, scenes, { text = "", from = scenes[0] }) {
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

const isRead = (line) => line.first && line.row.kind === "role" && line.row.value !== null;

/** `lines()` of the grid, `bring(line)` draws one that is out of sight, `leave(line)` goes to its first frame. */
export function typing({ body, book, lines, bring, leave }) {
  const scenesRead = () => lines().filter(isRead).map((line) => line.row.value);
  const fieldOf = (scene) => body.querySelector(`[data-reading="${CSS.escape(scene ?? "")}"]`);
  const isDue = (scene) => !book.of(scene).some((each) => !each.withdrawn_at) && !fieldOf(scene)?.value;

  function go(scene) {
    const line = lines().find((each) => isRead(each) && each.row.value === scene);
    if (!line) return;
    if (!fieldOf(scene)) bring(line);
    fieldOf(scene)?.focus();
  }

  const paste = (given) => openPaste(book, scenesRead(), given);

  body.addEventListener("paste", (event) => {
    const text = event.clipboardData.getData("text/plain");
    const { reading } = event.target.dataset;
    if (reading === undefined || !/[\n\r\t]./.test(text.trimEnd())) return;
    event.preventDefault();
    paste({ text, from: reading });
  });

  function press(event) {
    const scene = event.target.dataset.reading;
    if (event.key === "Escape") leave(lines().find((line) => line.row.value === scene));
    if (event.key !== "Enter") return;
    event.preventDefault();
    const scenes = scenesRead();
    const following = [...scenes.slice(scenes.indexOf(scene) + 1), ...scenes].find((name) => name !== scene && isDue(name));
    event.target.blur();
    if (following !== undefined) go(following);
  }

  return {
    press,
    go: (line) => go(line?.row.value),
    /** The first scene without a reading in the order of the rows, or with one that its frames speak against, whatever of them is drawn; else the first one. */
    first: () => go(scenesRead().find(isDue) ?? scenesRead().find((scene) => book.doubtOf(scene)) ?? scenesRead()[0]),
    paste: () => paste({}),
  };
}
