// Coefficients as the pages show them: what they hold for, and which of a series are in force.

import { h } from "./dom.js";
import { isUsual, number, quantity, tag, words } from "./format.js";
import { METHODS, coefficientLabel, headlineOf } from "./methods.js";

/** "ISO 3200, f/2.8, band 650": what a coefficient holds for. */
export function holdsFor(row) {
  return [
    row.iso != null ? `ISO ${row.iso}` : "",
    row.f_number != null ? `f/${number(row.f_number)}` : "",
    row.band != null ? `band ${words(row.band)}` : "",
    row.channel != null ? `channel ${row.channel}` : "",
    // after a colon: where in the frame
    row.model?.includes(":") ? row.model.split(":")[1] : "",
  ]
    .filter(Boolean)
    .join(", ");
}

/** A coefficient by its label and what it holds for. */
export const named = (row, method = row.method) => h("span", { title: row.name }, coefficientLabel(method, row.name), h("span", { class: "muted" }, ` ${holdsFor(row)}`));

const MOST_HEADLINES = 4;

/** The coefficient that a method is known for, each with U, of which one that is relative only has none; those of one f-number stand on the page of their version. */
export function headlines({ method, rows }) {
  const found = rows.filter((row) => row.name === headlineOf(method) && row.f_number === null);
  const stated = (row) => (row.flags.split(" ").includes("meter_certificate_missing") ? [quantity({ value: row.value, unit: row.unit }), " ", tag("relative only", "warn")] : quantity(row, { expanded: row.expanded_uncertainty !== null }));
  const line = (row) => h("div", {}, h("span", { class: "muted" }, `${holdsFor({ ...row, channel: null })} `), stated(row));
  return [found.slice(0, MOST_HEADLINES).map(line), found.length > MOST_HEADLINES ? h("div", { class: "muted small" }, `and ${found.length - MOST_HEADLINES} more`) : null];
}

const rankOf = ({ method }) => METHODS.findIndex(({ name }) => name === method);

/** The versions of a series (/v1/series/coefficients) that are in force at a time, each with its rows. */
export function inForce(rows, at = new Date()) {
  const versions = new Map();
  for (const row of rows) {
    if (new Date(row.valid_from) > at || (row.valid_to && new Date(row.valid_to) <= at)) continue;
    if (!versions.has(row.calibration_id)) versions.set(row.calibration_id, { ...row, rows: [], flags: [] });
    versions.get(row.calibration_id).rows.push(row);
  }
  for (const version of versions.values()) {
    version.flags = [...new Set(version.rows.flatMap((row) => row.flags.split(/[ ,;]+/).filter((flag) => flag && !isUsual(flag))))];
  }
  return [...versions.values()].sort((a, b) => rankOf(a) - rankOf(b) || a.version - b.version);
}
