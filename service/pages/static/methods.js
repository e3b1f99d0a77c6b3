// The calibration methods, as their specifications state them, and what their coefficients hold for.

import { h } from "./dom.js";
import { day, isUsual, number, quantity, tag, words } from "./format.js";
import { METHODS } from "./specification.js";

export { METHODS };

export const methodOf = (name) => METHODS.find((each) => each.name === name);
export const labelOf = (name) => methodOf(name).label;

export const isNight = (campaign) => campaign.kind === "measurement";

export const kindOf = (campaign) => `${isNight(campaign) ? "Measuring night, " : ""}${labelOf(campaign.method)}`;

/** A method in a night of measurements: field frames side by side, and nothing that a fit needs. */
export const atNight = (method) => ({ ...method, measures: true, roles: [ROLES.get("field")], grid: { columns: [] }, reference: null, has_checklist: false, finds_region: false, whole_frame: false });

export const coefficientLabel = (method, name) => methodOf(method).coefficients.find((each) => each.name === name)?.label ?? words(name);

export const choiceLabel = (method, field, value) => methodOf(method).parameters.find((each) => each.field === field)?.choices?.find((each) => each.value === value)?.label ?? words(value ?? "");

/** The name of the coefficient that is looked for first; how well a camera is known is how well this is. */
export const headlineOf = (name) => methodOf(name).coefficients[0].name;

/** A tolerance as it is typed, in the method's unit, as the API takes it: percent become a fraction. */
export const readTolerance = (name, typed) => (methodOf(name).tolerance_unit === "%" ? typed / 100 : Number(typed));

const ROLES = new Map(METHODS.flatMap((method) => method.roles).map((role) => [role.name, role]));

export const roleLabel = (name) => ROLES.get(name)?.label ?? name;

/** Every role, as the options of a list: those of the method first; in a night, its only one. */
export const roleOptions = (method) => [...new Set([...method.roles.map((role) => role.name), ...(method.measures ? [] : ROLES.keys())])].map((name) => [name, roleLabel(name)]);

/** The day of its first frame, which is mostly that of the flight. */
export const startOf = (campaign) => day(campaign.started_at ?? campaign.created_at);

/** A campaign's name: its project number, or what it is and when it was begun. */
export const titleOf = (campaign) => campaign.project_number ?? `${kindOf(campaign)}, ${startOf(campaign)}`;

export function nameOf(campaigns, id) {
  const found = campaigns.find((each) => each.id === id);
  return found ? titleOf(found) : "a campaign";
}

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
