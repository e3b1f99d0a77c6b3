// A measurement's figures: large ones first.

import { figure, h, table } from "../dom.js";
import { number, percent, quantity, relative, unit, words } from "../format.js";
import { regionOf, titleOf } from "./words.js";

export function drawFigures(found) {
  const apart = found.grid && found.region_origin !== "grid" ? " The cells are those of the surface, not of this region." : "";
  return [
    found.mean ? h("p", { class: apart ? "note warn" : "small muted" }, `Mean, median, range${found.illuminance ? ", illuminance" : ""}: of ${regionOf(found)}.${apart}`) : null,
    found.seen_from ? h("p", { class: "note" }, h("strong", {}, "Seen from above. "), found.seen_from_detail) : null,
    h("dl", { class: "figures" }, figures(found).map((each) => figure(...each))),
    found.index ? bands(found.index) : null,
    found.percentiles.length ? h("details", { class: "percentiles" }, h("summary", {}, "Percentiles of single pixels"), percentiles(found)) : null,
  ];
}

const above = (found) => (found.seen_from ? ", seen from above" : "");

function figures(found) {
  const { mean, grid } = found;
  const rows = [[found.index ? titleOf(found) : "Mean", quantity(mean), found.index ? "of the region’s mean reflectances" : `u is ${relative(mean.value, mean.standard_uncertainty)}${found.uncertainty_scope === "relative_only" ? ", relative only: no meter certificate" : ""}${found.pixels ? `; ${number(found.pixels, 9)} pixels` : ""}`]];
  if (found.median) rows.push(["Median", quantity(found.median)]);
  if (found.min) rows.push(["Range of pixels", h("span", { class: "nowrap" }, `${number(found.min.value, 3)} – ${number(found.max.value, 3)}`), mean.unit === "1" ? "" : unit(mean.unit)]);
  if (grid) rows.push(["Overall uniformity U_o", quantity(found.u_o), `smallest / mean of the cells${above(found)}`], ["Range of cells", `${number(found.l_min_cd_m2.value, 3)} – ${number(found.l_max_cd_m2.value, 3)}`, "cd/m²"]);
  if (found.u_l) rows.push(["Longitudinal uniformity U_l, worst row", quantity(found.u_l.reduce((worst, each) => (each.value < worst.value ? each : worst)))]);
  if (found.illuminance) rows.push(["Illuminance π L / ρ", quantity(found.illuminance)]);
  if (found.saturated_share) rows.push(["Saturated", percent(found.saturated_share), "of the region’s samples"]);
  if (found.reflected) rows.push(...reflected(found.reflected));
  if (found.place?.transform) rows.push(["Place of the map, worst corner", `± ${number(found.place.u_corner_m, 2)} m`, `${number(found.place.height_above_ground_m, 4)} m above level ground; ± ${number(found.place.u_centre_m, 2)} m in the centre. ${found.place.detail}`]);
  else if (found.place) rows.push(["Place of the map", "–", found.place.detail]);
  for (const each of found.alignment ?? []) rows.push([`Alignment of ${words(each.band)}`, `${number(each.residual_px, 2)} px`, ALIGNED[each.by](each)]);
  return rows;
}

const patches = (row) => `${row.patches} of ${row.tried} patches agree`;
const ALIGNED = {
  lens_data: (row) => `assumed, by lens data alone: ${patches(row)}`,
  lens_data_and_correlation: (row) => `left after a correction by ${number(Math.hypot(...row.shift_px), 3)} px; ${patches(row)}`,
  correlation: (row) => `left, by correlation alone; ${patches(row)}`,
};

const BASES = { levelled: "converted to a level surface", horizontal: "on a level surface, by the camera", compensated: "as the camera compensated it", oriented: "as the sensor was oriented" };
const sunshine = (row) => {
  const other = row.i_ss_oriented !== undefined && row.i_ss_basis !== "oriented" ? `, ${number(row.i_ss_oriented, 4)} as the sensor was oriented` : "";
  return `sunshine ${number(row.i_ss, 4)} ${BASES[row.i_ss_basis] ?? ""}${other}`;
};

function reflected(row) {
  return [
    ["Sensor signal", number(row.i_sq, 4), row.i_ss === undefined ? "without the sunshine sensor" : sunshine(row)],
    ["K of the band", number(row.reflectance_k, 4), row.incidence_angle_deg ? `surface tilted by ${number(row.incidence_angle_deg, 3)}°` : "surface normal to the light"],
    ["Outside 0 to 1", percent(row.below_zero_share + row.above_one_share), "of the region’s pixels"],
  ];
}

function bands({ bands: rows }) {
  const columns = [
    { head: "Band", header: true, cell: (row) => words(row.band) },
    { head: "Reflectance", class: "number", cell: (row) => quantity(row.reflectance) },
    { head: "K", class: "number", cell: (row) => number(row.reflectance_k) },
    { head: "Sensor", class: "number", cell: (row) => number(row.i_sq) },
    { head: "Sunshine", class: "number", cell: (row) => (row.i_ss === undefined ? "–" : number(row.i_ss)) },
  ];
  return h("div", { class: "bands" }, table(columns, rows, { caption: "Bands of the index" }));
}

function percentiles(found) {
  const rows = [
    ["smallest", found.min],
    ...found.percentiles.filter((row) => row.percent < 50).map(told),
    ["50 %", found.median],
    ...found.percentiles.filter((row) => row.percent > 50).map(told),
    ["largest", found.max],
  ];
  return table([{ head: "Percentile", header: true, cell: ([name]) => name }, { head: "Value", class: "number", cell: ([, value]) => quantity(value) }], rows, { caption: "Percentiles of single pixels" });
}

const told = (row) => [`${row.percent} %`, row.luminance ?? row.reflectance];
