// Readings from the cells of a spreadsheet; every invalid line is reported.

import { wrong } from "../states.js";
import { readNumber } from "./forms.js";

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
export function readSheet(text, { unit, headless = false, scenes = [] }) {
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
