// What the name of a quantity in the API says: its label and its unit.

import { exposureTime, number, time, words } from "./format.js";

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

/** "Pixel pitch [µm]" */
export function titleOf([head, unit]) {
  const said = head.replace(/^gsd\b/, "GSD");
  return `${said.charAt(0).toUpperCase()}${said.slice(1)}${unit ? ` [${unit}]` : ""}`;
}
