// Frames, readings and gaps as a matrix, by the axes that the method states.

import { exposureTime, groupBy, inOrder, natural, number, words } from "../format.js";
import { roleLabel } from "../methods.js";

const compare = (a, b) => (typeof a === "number" && typeof b === "number" ? a - b : natural(String(a ?? "\uffff"), String(b ?? "\uffff")));

const SAYS = { iso: (value) => `ISO ${value}`, f_number: (value) => `f/${number(value, 3)}`, exposure_time_s: exposureTime, band: words };
const sayValue = (axis, value) => SAYS[axis]?.(value) ?? String(value);

/**
 * {columns: [{values, heads}], lines: [{key, row, first, cells: [{frame} | {gap} | undefined]}], order: [frames]}.
 * A row has as many lines as its fullest cell shows frames: of more than `MOST_REPEATS` the first few, and a {pile} of the others
 * unless its key is among the `unfolded`; without columns its frames lie side by side, `across` a line.
 * With `perCard`, for a phone, a line holds as many cells as that, whatever their columns.
 */
export function layOut({ method, frames, withdrawn = [], readings = [], gaps = [], across = 6, perCard = 0, unfolded = new Set(), shows = () => true, showsGaps = true }) {
  const { rows: axis, columns: axes = [] } = method.grid;
  const roles = method.roles.map((role) => role.name);
  const rankOf = (role) => (roles.includes(role) ? roles.indexOf(role) : roles.length);
  const splits = (role) => axis && (axis !== "scene" || method.roles.some((each) => each.name === role && each.has_scene));
  const rows = new Map();
  const rowOf = (kind, role, value, label) => {
    const key = JSON.stringify([kind, role, value]);
    if (!rows.has(key)) rows.set(key, { key, kind, role, value, label, frames: [], gaps: [] });
    return rows.get(key);
  };
  const named = (role, value, frame) => {
    if (axis === "scene" && splits(role)) return value ?? "No scene";
    const base = `${roleLabel(role)} frames`;
    if (!splits(role)) return base;
    const said = axis === "capture_id" ? (frame?.taken_at ?? String(value)).replace("T", " ").slice(0, 19) : sayValue(axis, value);
    return rankOf(role) ? `${base}, ${said}` : said;
  };
  const place = (role, values, frame) => {
    const value = splits(role) ? (values[axis] ?? null) : null;
    return rowOf("role", role, value, named(role, value, frame));
  };
  const isPlaced = (frame) => axes.every((name) => frame[name] !== null) && (!splits(frame.role) || axis === "scene" || frame[axis] !== null);
  for (const frame of frames) (isPlaced(frame) ? place(frame.role, frame, frame) : rowOf("unplaced", null, null, "No exposure yet")).frames.push(frame);
  for (const frame of withdrawn) rowOf("withdrawn", null, null, "Withdrawn").frames.push(frame);
  const lit = method.roles.find((role) => role.has_scene)?.name;
  if (axis === "scene" && lit) for (const { scene } of readings) place(lit, { scene });
  for (const gap of showsGaps ? gaps : []) {
    const known = !splits(gap.role) || axis in gap.at;
    (known ? place(gap.role, gap.at) : rowOf("next", null, null, "To photograph")).gaps.push(gap);
  }
  const columns = makeColumns(axes, [...rows.values()].filter((row) => row.kind === "role"), across);
  const kinds = ["role", "next", "unplaced", "withdrawn"];
  const sorted = [...rows.values()].sort((a, b) => kinds.indexOf(a.kind) - kinds.indexOf(b.kind) || rankOf(a.role) - rankOf(b.role) || compare(a.value, b.value));
  const lines = sorted.flatMap((row) => linesOf(row, row.kind === "role" || row.kind === "next" ? axes : [], columns, { shows, perCard, unfolded }));
  return { columns, lines, order: lines.flatMap((line) => line.cells.flatMap((cell) => cell?.frame ?? cell?.pile?.frames ?? [])) };
}

function makeColumns(axes, rows, across) {
  if (!axes.length) return Array.from({ length: across }, () => ({ values: [], heads: [] }));
  const found = new Map();
  const add = (from) => {
    const values = axes.map((name) => from[name]);
    if (values.every((value) => value !== undefined && value !== null)) found.set(JSON.stringify(values), values);
  };
  for (const row of rows) for (const each of [...row.frames, ...row.gaps.map((gap) => gap.at)]) add(each);
  const sorted = [...found.values()].sort((a, b) => a.map((value, at) => compare(value, b[at])).find((order) => order !== 0) ?? 0);
  const columns = sorted.map((values) => ({ values, heads: values.map((value, at) => sayValue(axes[at], value)) }));
  return columns.length ? columns : makeColumns([], rows, across);
}

const MOST_REPEATS = 4;

function linesOf(row, axes, columns, { shows, perCard, unfolded }) {
  const shown = inOrder(row.frames.filter(shows), (frame) => frame.filename);
  const lines = [];
  const put = (line, column, cell) => ((lines[line] ??= Array.from({ length: columns.length }))[column] = { ...cell, column });
  if (axes.length) {
    const at = new Map(columns.map(({ values }, column) => [JSON.stringify(values), column]));
    const cells = groupBy(shown, (frame) => at.get(JSON.stringify(axes.map((name) => frame[name]))));
    for (const [column, frames] of cells) pileUp(frames, `${row.key}${column}`, unfolded).forEach((cell, line) => put(line, column, cell));
    for (const gap of row.gaps) {
      const column = columns.findIndex(({ values }) => axes.every((name, place) => !(name in gap.at) || gap.at[name] === values[place]));
      if (column >= 0 && !cells.has(column)) put(0, column, { gap });
    }
  } else [...shown.map((frame) => ({ frame })), ...row.gaps.map((gap) => ({ gap }))].forEach((cell, index) => put(Math.floor(index / columns.length), index % columns.length, cell));
  // a scene that was read and not yet photographed has a line too
  if (!lines.length && row.kind === "role" && !row.frames.length) lines.push(Array.from({ length: columns.length }));
  if (perCard) {
    const every = lines.flat().filter(Boolean);
    lines.splice(0, lines.length, ...Array.from({ length: Math.ceil(every.length / perCard) || lines.slice(0, 1).length }, (_, at) => every.slice(at * perCard, (at + 1) * perCard)));
  }
  return lines.map((cells, index) => ({ key: `${row.key}${index}`, row, first: index === 0, cells }));
}

function pileUp(frames, key, unfolded) {
  const every = frames.map((frame) => ({ frame }));
  if (frames.length <= MOST_REPEATS) return every;
  if (unfolded.has(key)) return [...every, { pile: { key, more: 0, toCheck: 0, frames: [] } }];
  const isWanting = (frame) => ["warn", "fail"].includes(frame.outcome) && frame.left_out === null;
  const rest = every.slice(MOST_REPEATS - 1).map(({ frame }) => frame);
  return [...every.slice(0, MOST_REPEATS - 1), { pile: { key, more: rest.length, toCheck: rest.filter(isWanting).length, frames: rest } }];
}
