// A parameter as its method's specification states it: label, unit, and its value in words.

import { h } from "./dom.js";
import { number, percent, unit, words } from "./format.js";

const UNITS = { deg: "°", um: "µm" };

/** A fraction is typed and shown in percent; a ratio that may be above 1 is not. */
export const isFraction = (parameter) => parameter.unit === "1" && parameter.maximum !== undefined && parameter.maximum <= 1;

/** "%", "µm", or "" for a plain number. */
export const unitOf = (parameter) => (isFraction(parameter) ? "%" : parameter.unit === "1" ? "" : (UNITS[parameter.unit] ?? unit(parameter.unit)));

/** The values of a version's parameters as a list of labels and values; `parameters` are those of its method. */
export function parameterFacts(values, parameters) {
  const known = new Map(parameters.map((each) => [each.field, each]));
  const names = [...known.keys(), ...Object.keys(values).filter((name) => !known.has(name))].filter((name) => values[name] !== null && values[name] !== undefined);
  return h("dl", { class: "facts" }, names.map((name) => [h("dt", {}, known.get(name)?.label ?? words(name)), h("dd", {}, sayValue(values[name], known.get(name)))]));
}

/** A value in words; of a parameter in its unit, or by the label of its choice. */
export function sayValue(value, parameter = { unit: "1" }) {
  if (value === undefined || value === null) return "–";
  const written = parameter.unit === "1" ? "" : ` ${unitOf(parameter)}`.replace(" °", "°");
  const one = (each) => (isFraction(parameter) ? percent(each, 6) : `${number(each, 6)}${written}`);
  const chosen = parameter.choices?.find((each) => each.value === value);
  if (chosen) return chosen.label;
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "number") return one(value);
  if (Array.isArray(value)) return value.every((each) => typeof each === "number") ? value.map(one).join(" to ") : value.map((each) => h("div", {}, sayValue(each)));
  if (typeof value === "object") return parameterFacts(value, parameter.members ?? []);
  if (parameter.version_of) return h("code", { title: value }, `${value.slice(0, 16)}…`);
  return value.includes("\n") ? `own table of ${value.trim().split("\n").length} lines` : value;
}
