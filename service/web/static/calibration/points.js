// Every point of the fit in a table, used or left out; of luminance in chosen columns, else in the method's own.

import { h, may, table } from "../dom.js";
import { exposureTime, fixed, number, tag, words } from "../format.js";
import { empty } from "../states.js";
import { shorten } from "../shorten.js";

const UNITS = { px: "px", dn: "DN", dn2: "DN²", s: "s", deg: "°", mm: "mm", um: "µm", cd_m2: "cd/m²" };
const HIDDEN = new Set(["frame", "frame_id", "used", "left_out", "capture_id", "figure"]);

export function drawPoints({ method, points, parameters }, choice) {
  if (!points.length) return empty("No points", "This version keeps none.");
  const columns = [choosing(choice), frameColumn, ...(method === "luminance" ? LUMINANCE : ownColumns(points)), verdictColumn(parameters.exclude ?? [])].filter(Boolean);
  const draw = (rows) => {
    const drawn = table(columns, rows, { caption: "Points of the fit", row: (point) => ({ class: point.used ? null : "out", "data-frame-id": point.frame_id }) });
    if (choice) mark(drawn, choice);
    return drawn;
  };
  return shorten(points, draw, 12);
}

const frameColumn = { head: "Frame", header: true, class: "nowrap", cell: (point) => point.frame };
/** Of what somebody left out their reason alone: who it was stands with what the version was made from. */
const verdictColumn = (exclude) => ({
  head: "In the fit",
  cell: (point) => {
    if (point.used) return tag("used", "good");
    const why = exclude.find((each) => each.frame === point.frame)?.reason ?? point.left_out;
    return h("span", {}, tag("left out", "warn"), h("span", { class: "small why-out" }, why));
  },
});

const LUMINANCE = [
  { head: "Scene", class: "nowrap", cell: (point) => point.scene },
  { head: "Exposure", cell: (point) => h("span", { class: "nowrap" }, `${exposureTime(point.exposure_time_s)}, f/${number(point.f_number, 3)}, ISO ${number(point.iso, 6)}`) },
  { head: "L meter", class: "number", cell: (point) => withUnit(point.luminance_cd_m2, "cd/m²") },
  { head: "X", class: "number", cell: (point) => number(point.rhs) },
  { head: "Signal above dark", class: "number", cell: (point) => withUnit(point.adjusted_signal_dn, "DN", 5) },
  { head: "L fit", class: "number", cell: (point) => withUnit(point.fitted_luminance_cd_m2, "cd/m²") },
  { head: "Residual", class: "number", cell: (point) => (present(point.residual_rel) ? signed(point.residual_rel) : "–") },
];

const present = (value) => value !== null && value !== undefined;
const signed = (share) => `${share > 0 ? "+" : ""}${fixed(100 * share, 2)} %`;
const withUnit = (value, unit, digits = 4) => (present(value) ? [number(value, digits), h("span", { class: "unit" }, ` ${unit}`)] : "–");

/** A column for each figure that some point has, named as the API names it. */
function ownColumns(points) {
  const names = [...new Set(points.flatMap(Object.keys))].filter((name) => !HIDDEN.has(name) && points.some((point) => present(point[name])));
  return names.map((name) => {
    const [head, unit] = headOf(name);
    const numeric = points.some((point) => typeof point[name] === "number");
    return { head: unit ? `${head} [${unit}]` : head, class: numeric ? "number" : null, cell: (point) => figure(name, point[name]) };
  });
}

function headOf(name) {
  if (/_(rel|share)$/.test(name)) return [words(name.replace(/_(rel|share)$/, "")), "%"];
  const suffix = Object.keys(UNITS).find((each) => name.endsWith(`_${each}`));
  return suffix ? [words(name.slice(0, -suffix.length - 1)), UNITS[suffix]] : [words(name), ""];
}

function figure(name, value) {
  if (!present(value)) return "–";
  if (name === "exposure_time_s") return number(value, 4);
  if (/_(rel|share)$/.test(name)) return number(100 * value, 3);
  if (typeof value === "number") return number(value, 5);
  if (Array.isArray(value)) return value.length ? String(value.length) : "none";
  return String(value);
}

function choosing(choice) {
  if (!choice || !may("calibrate")) return null;
  return {
    head: h("span", { class: "hidden" }, "Choose"),
    class: "pick",
    cell: (point) =>
      point.used
        ? h("input", { type: "checkbox", "aria-label": `Choose ${point.frame}`, checked: choice.has(point.frame_id), onchange: (event) => choice.set(point.frame_id, point.frame, event.target.checked) })
        : "",
  };
}

/** Rows follow what is chosen elsewhere. */
function mark(drawn, choice) {
  const show = () => {
    for (const row of drawn.querySelectorAll("tr[data-frame-id]")) {
      const chosen = choice.has(row.dataset.frameId);
      row.classList.toggle("chosen-row", chosen);
      const box = row.querySelector("input[type=checkbox]");
      if (box) box.checked = chosen;
    }
  };
  choice.addEventListener("change", show);
  show();
}
