// Every point of the fit in a table, used or not: selected columns for points of a curve, else those of the method.
// Its status is next to its name, so that it is visible on a phone too.

import { filename, h, may, shorten, table } from "../dom.js";
import { exposureTime, fixed, number, tag, withUncertainty, words } from "../format.js";
import { inOrder } from "../groups.js";
import { WRITTEN, headOf, titleOf } from "../names.js";
import { empty } from "../states.js";

const HIDDEN = new Set(["frame", "frame_id", "used", "left_out", "capture_id", "figure", "residual_rel"]);
const U = "standard_uncertainty";

export function drawPoints({ points, parameters, diagnostics }, choice) {
  if (!points.length) return empty("No points", "This version has no points.");
  const residual = points.some((point) => present(point.residual_rel)) ? residualColumn : null;
  const columns = [choosing(choice), frameColumn, verdictColumn(parameters.exclude ?? []), residual, ...(diagnostics.iso_fits ? CURVE : ownColumns(points))].filter(Boolean);
  const draw = (rows) => {
    const drawn = table(columns, rows, { caption: "Points of the fit", row: (point) => ({ class: point.used ? null : "out", "data-frame-id": point.frame_id }) });
    if (choice) mark(drawn, choice);
    return drawn;
  };
  return shorten(inOrder(points, (point) => `${point.scene ?? ""} ${point.frame}`), draw, 12);
}

const frameColumn = { head: "Frame", header: true, class: "frame-name", cell: (point) => filename(point.frame) };
/** Of what somebody left out their reason alone: who it was stands with what the version was made from. */
const verdictColumn = (exclude) => ({
  head: "Status",
  class: "in-fit",
  cell: (point) => {
    if (point.used) return tag("used", "good");
    const why = exclude.find((each) => each.frame === point.frame)?.reason ?? point.left_out;
    return h("span", {}, tag("not used", "warn"), h("span", { class: "small why-out" }, why));
  },
});

const residualColumn = { head: "Residual", class: "number", cell: (point) => (present(point.residual_rel) ? signed(point.residual_rel) : "–") };

const CURVE = [
  { head: "Scene", class: "nowrap", cell: (point) => point.scene },
  { head: "Exposure", cell: (point) => h("span", { class: "nowrap" }, `${exposureTime(point.exposure_time_s)}, f/${number(point.f_number, 3)}, ISO ${point.iso}`) },
  { head: "L meter", class: "number", cell: (point) => withUnit(point.luminance_cd_m2, "cd/m²") },
  { head: "X", class: "number", cell: (point) => number(point.rhs) },
  { head: "Signal above dark", class: "number", cell: (point) => withUnit(point.adjusted_signal_dn, "DN", 5) },
  { head: "L fit", class: "number", cell: (point) => withUnit(point.fitted_luminance_cd_m2, "cd/m²") },
];

const present = (value) => value !== null && value !== undefined;
const signed = (share) => `${share > 0 ? "+" : ""}${fixed(100 * share, 2)} %`;
const withUnit = (value, unit, digits = 4) => (present(value) ? [number(value, digits), h("span", { class: "unit" }, ` ${unit}`)] : "–");

/** A column for each figure that some point has; its uncertainty stands in it. */
function ownColumns(points) {
  const known = [...new Set(points.flatMap(Object.keys))].filter((name) => !HIDDEN.has(name) && points.some((point) => present(point[name])));
  const names = known.filter((name) => !name.includes(U));
  return names.map((name) => {
    const numeric = points.some((point) => typeof point[name] === "number");
    const u = known.find((each) => each.includes(U) && (each === withU(name) || (name === "value" && each === U)));
    return { head: titleOf(WRITTEN[name] ? [WRITTEN[name][0], ""] : headOf(name === "value" ? points[0].figure : name)), class: numeric ? "number" : null, cell: (point) => figure(name, point[name], point[u]) };
  });
}

/** i_sq_standard_uncertainty, gradient_standard_uncertainty_rel */
const withU = (name) => (name.endsWith("_rel") ? name.replace(/_rel$/, `_${U}_rel`) : `${name}_${U}`);

function figure(name, value, u) {
  if (!present(value)) return "–";
  if (WRITTEN[name]) return WRITTEN[name][1](value);
  const scale = /_(rel|share)$/.test(name) ? 100 : 1;
  if (present(u)) return withUncertainty(scale * value, scale * u);
  if (scale !== 1) return number(100 * value, 3);
  if (typeof value === "number") return number(value, name.endsWith("_dn") ? 5 : 4);
  if (Array.isArray(value)) return value.length ? String(value.length) : "none";
  return name === "band" ? words(value) : String(value);
}

function choosing(choice) {
  if (!choice || !may("calibrate")) return null;
  return {
    head: h("span", { class: "hidden" }, "Select"),
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
