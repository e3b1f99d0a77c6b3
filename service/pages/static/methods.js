// The calibration methods, as their specifications state them.

import { words } from "./format.js";
import { METHODS } from "./specification.js";

export { METHODS };

export const methodOf = (name) => METHODS.find((each) => each.name === name);
export const labelOf = (name) => methodOf(name).label;

export const isNight = (campaign) => campaign.kind === "measurement";

/** What a campaign is: its method, or a night of measurements. */
export const kindOf = (campaign) => `${isNight(campaign) ? "Measuring night, " : ""}${labelOf(campaign.method)}`;

/** A method in a night of measurements: field frames side by side, and nothing that a fit needs. */
export const atNight = (method) => ({ ...method, measures: true, roles: [ROLES.get("field")], grid: { columns: [] }, reference: null, has_checklist: false, finds_region: false, whole_frame: false });

/** The label of a method's coefficient. */
export const coefficientLabel = (method, name) => methodOf(method).coefficients.find((each) => each.name === name)?.label ?? words(name);

/** The label of one of a parameter's choices. */
export const choiceLabel = (method, field, value) => methodOf(method).parameters.find((each) => each.field === field)?.choices?.find((each) => each.value === value)?.label ?? words(value ?? "");

/** The name of the coefficient that is looked for first; how well a camera is known is how well this is. */
export const headlineOf = (name) => methodOf(name).coefficients[0].name;

/** A tolerance as it is typed, in the method's unit, as the API takes it: percent become a fraction. */
export const readTolerance = (name, typed) => (methodOf(name).tolerance_unit === "%" ? typed / 100 : Number(typed));

const ROLES = new Map(METHODS.flatMap((method) => method.roles).map((role) => [role.name, role]));

export const roleLabel = (name) => ROLES.get(name)?.label ?? name;

/** Every role, as the options of a list: those of the method first; in a night, its only one. */
export const roleOptions = (method) =>
  [...new Set([...method.roles.map((role) => role.name), ...(method.measures ? [] : ROLES.keys())])].map((name) => [name, roleLabel(name)]);
