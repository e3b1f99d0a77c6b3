// Figures as they are written in a report, and items in the groups and the order in which they are listed.

import { h } from "./dom.js";

const LEAST_SHARE = 1e-5;
const MINUS = "−";

/** The decimals at which a standard uncertainty has two significant digits; below 0 left of the point. */
function decimalsOf(uncertainty) {
  if (!(uncertainty > 0)) return null;
  const power = Math.floor(Math.log10(uncertainty));
  // 0.0996 is 0.10 at two digits
  const rounded = Number(uncertainty.toPrecision(2));
  return 1 - Math.max(power, Math.floor(Math.log10(rounded)));
}

/** A plain number: at most `digits` significant digits, narrow spaces that do not break in thousands. */
export function number(value, digits = 4) {
  if (value === undefined || value === null) return "–";
  const size = Math.abs(value);
  if (size !== 0 && (size >= 1e7 || size < 1e-4)) return scientific(value, digits);
  return grouped(Number(value.toPrecision(digits)).toString());
}

export const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

/** A text of at most so many characters; names differ at their ends, so the middle goes. */
export const shortly = (text, most) => (text.length <= most ? text : `${text.slice(0, Math.ceil((most - 1) / 2))}…${text.slice(-Math.floor((most - 1) / 2))}`);

/** A number with a fixed count of decimals; what is rounded to zero has no sign. */
export const fixed = (value, decimals) => grouped(value.toFixed(decimals).replace(/^-(?=[0.]+$)/, ""));

/** A value rounded where its uncertainty is: "33.10 ± 0.41". */
export function withUncertainty(value, uncertainty) {
  const decimals = decimalsOf(uncertainty);
  if (decimals === null) return number(value);
  if (decimals > 7 || Math.abs(value) >= 1e7) return `${scientific(value, 4)} ± ${scientific(uncertainty, 2)}`;
  if (decimals >= 0) return `${fixed(value, decimals)} ± ${fixed(uncertainty, decimals)}`;
  const step = 10 ** -decimals;
  return `${grouped(String(Math.round(value / step) * step))} ± ${grouped(String(Math.round(uncertainty / step) * step))}`;
}

/** A reported quantity {value, standard_uncertainty, unit} as an element; with `expanded` its U. */
export function quantity(reported, { expanded = false } = {}) {
  if (!reported) return h("span", { class: "muted" }, "–");
  const [value, uncertainty] = withUncertainty(reported.value, expanded ? reported.expanded_uncertainty : reported.standard_uncertainty).split(" ± ");
  return h("span", { class: "quantity", title: expanded ? "value ± expanded uncertainty, 95 %" : "value ± standard uncertainty" },
    h("span", { class: "nowrap" }, value, uncertainty ? h("span", { class: "u" }, ` ± ${uncertainty}`) : null),
    reported.unit && reported.unit !== "1" ? h("span", { class: "unit" }, ` ${unit(reported.unit)}`) : null,
  );
}

export const relative = (value, uncertainty) => (value ? percent(uncertainty / Math.abs(value)) : "–");

/** A share in percent at two significant digits, zeros among them, as an uncertainty has; with more `digits` as it was stated. */
export function percent(share, digits = 2) {
  const value = 100 * share;
  if (digits > 2 || !value) return `${number(value, digits)} %`;
  if (Math.abs(share) < LEAST_SHARE) return `< ${100 * LEAST_SHARE} %`;
  return `${grouped(Math.abs(value) < 9.95 ? value.toPrecision(2) : String(Math.round(value)))} %`;
}

/** DN*m2/(cd*s) as DN·m²/(cd·s). */
export function unit(text) {
  return text.replaceAll("*", "·").replace(/([a-z])(-?)([23])\b/gi, (_, letter, sign, power) => `${letter}${sign ? "⁻" : ""}${power === "2" ? "²" : "³"}`);
}

export const day = (instant) => (instant ? instant.slice(0, 10) : "–");

export const hasZone = (stamp) => /(Z|[+-]\d\d:\d\d)$/.test(stamp);

/** 2026-05-01 08:00 UTC, as an element that machines read too; of a clock without a zone as it showed it. */
export function time(instant) {
  if (!instant) return h("span", { class: "muted" }, "–");
  if (!hasZone(instant)) return h("span", { class: "nowrap", title: "As the camera’s clock showed it; the file states no time zone" }, instant.slice(0, 16).replace("T", " "));
  const utc = new Date(instant).toISOString();
  return h("time", { datetime: instant, class: "nowrap", title: `${instant} (${ago(instant)})` }, `${utc.slice(0, 10)} ${utc.slice(11, 16)} UTC`);
}

export const cameraName = ({ make, model, serial }) => `${make} ${model} ${serial}`;

/** The service's own sentences write for machines: 2026-05-01T08:00:00Z becomes 2026-05-01 08:00 UTC, cd/m2 cd/m², and 3% 3 %. */
export const typeset = (text) => text.replace(/(\d{4}-\d\d-\d\d)T(\d\d:\d\d)(?::\d\d(?:\.\d+)?)?(?:Z|\+00:00)/g, "$1 $2 UTC").replaceAll("cd/m2", "cd/m²").replace(/(\d)%/g, "$1 %");

export function ago(instant, now = Date.now()) {
  const seconds = (now - new Date(instant).getTime()) / 1000;
  return seconds < 0 ? `in ${span(-seconds)}` : seconds < 10 ? "just now" : `${span(seconds)} ago`;
}

/** A length of time in one unit: "40 s", "3 days", "5 months". */
export function span(seconds) {
  const steps = [[60, 1, "s"], [5400, 60, "min"], [129600, 3600, "h"], [5184000, 86400, "day"], [63072000, 2629800, "month"], [Infinity, 31557600, "year"]];
  const [, size, name] = steps.find(([limit]) => seconds < limit);
  const count = Math.round(seconds / size);
  return `${count} ${name}${name.length > 3 || name === "day" ? (count === 1 ? "" : "s") : ""}`;
}

export function bytes(count) {
  const powers = ["B", "kB", "MB", "GB", "TB"];
  const power = count < 1000 ? 0 : Math.min(Math.floor(Math.log10(count) / 3), 4);
  return `${number(count / 1000 ** power, 3)} ${powers[power]}`;
}

/** As the camera names it: 1/250 s, 0.5 s, 2 s. */
export function exposureTime(seconds) {
  if (seconds === undefined || seconds === null) return "–";
  if (seconds >= 0.3) return `${number(seconds, 3)} s`;
  const whole = Math.round(1 / seconds);
  return `1/${Math.abs(seconds * whole - 1) < 0.01 ? whole : number(1 / seconds, 3)} s`;
}

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

export const words = (name) => name.replaceAll("_", " ");

export const isUsual = (flag) => flag === "meter_repeatability_estimated";

/** A state as a coloured word; the colour never says it alone. */
export const tag = (word, kind = KINDS[word] ?? "") => h("span", { class: `tag ${isUsual(word) ? "" : kind}` }, stateWords(word));

export const stateWords = (state) => SAID[state] ?? words(state);

const SAID = {
  quarantined: "stopped after 3 attempts", superseded: "replaced", pass: "passes", fail: "fails", warn: "check", pending: "waiting",
  calibration_superseded: "calibration replaced", dark_exposure_differs: "dark frames at another exposure",
  dark_from_black_level: "no dark frames, black level used", meter_repeatability_estimated: "meter repeatability estimated from scenes",
  rho_cross_check: "luminance and illuminance disagree", roi_elsewhere: "measured beyond the calibrated region", roi_empty: "region is empty",
  roi_outside_frame: "region outside the frame", roi_unfit: "region does not fit this frame", apex_missing: "no APEX values, nominal exposure used",
  prnu_large: "PRNU above 5 %", diffuse_assumed: "diffuse surface assumed", panel_only: "sunshine sensor not used",
  body_and_lens_confounded: "body and lens not told apart", mirror_not_excluded: "mirrored board not excluded",
  led: "LED", led_ripple: "LED with a simple or unknown driver", led_phase_dimmed: "LED dimmed by phase",
};

const KINDS = {
  succeeded: "good", published: "good", extracted: "good", pass: "good", in_force: "good",
  running: "live", queued: "live", received: "live", read: "live", pending: "live",
  draft: "warn", warn: "warn", superseded: "",
  fail: "bad", failed: "bad", quarantined: "bad", refused: "bad", revoked: "bad",
};

function scientific(value, digits) {
  const [mantissa, power] = value.toExponential(digits - 1).split("e");
  const raised = [...String(Number(power))].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)])).join("");
  return `${String(Number(mantissa)).replace("-", MINUS)} × 10${raised}`;
}

function grouped(text) {
  const [whole, part] = text.replace("-", MINUS).split(".");
  const spaced = whole.length > 4 + whole.startsWith(MINUS) ? whole.replace(/\B(?=(\d{3})+$)/g, "\u202f") : whole;
  return part === undefined ? spaced : `${spaced}.${part}`;
}

/** DJI_9 before DJI_10. */
export const natural = new Intl.Collator(undefined, { numeric: true }).compare;

export const inOrder = (items, nameOf) => [...items].sort((a, b) => natural(nameOf(a), nameOf(b)));

export function groupBy(items, keyOf) {
  const groups = new Map();
  for (const item of items) {
    const key = keyOf(item);
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(item);
  }
  return groups;
}

// ---- what the name of a quantity in the API says: its label and its unit

const UNITS = { cycles_per_pixel: "cycles/px", w_m2_nm: "W/(m²·nm)", cd_m2: "cd/m²", deg_s: "°/s", km_h: "km/h", m_s: "m/s", px: "px", dn: "DN", dn2: "DN²", deg: "°", mm: "mm", um: "µm", s: "s", m: "m" };
const HEADS = { iso: "ISO", i_sq: "I_SQ", i_ss: "I_SS", reflectance_k: "K", mtf50_cycles_per_pixel: "MTF50", fov_deg: "field of view" };
/** Quantities that have a way of their own to be written. */
export const WRITTEN = { at_s: ["taken", (value) => time(new Date(1000 * value).toISOString())], exposure_time_s: ["exposure", exposureTime], longest_exposure_s: ["longest exposure", exposureTime], f_number: ["f-number", (value) => `f/${number(value, 3)}`] };

/** ["pixel pitch", "µm"] of pixel_pitch_um; a relative one is told in percent. */
export function headOf(name) {
  const suffix = Object.keys(UNITS).find((each) => name.endsWith(`_${each}`));
  if (HEADS[name]) return [HEADS[name], suffix ? UNITS[suffix] : ""];
  if (/_(rel|share)$/.test(name)) return [words(name.replace(/_(rel|share)$/, "")), "%"];
  return suffix ? [words(name.slice(0, -suffix.length - 1)), UNITS[suffix]] : [words(name), ""];
}

export function titleOf([head, unit]) {
  const said = head.replace(/^gsd\b/, "GSD");
  return `${said.charAt(0).toUpperCase()}${said.slice(1)}${unit ? ` [${unit}]` : ""}`;
}
