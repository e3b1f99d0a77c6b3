// The cells of a lit surface, as they lie on the ground.

import { figure, h } from "../dom.js";
import { number, quantity, withUncertainty } from "../format.js";
import { Scale } from "./colours.js";

export function drawGrid(found) {
  if (!found.grid) return null;
  const { cells } = found.grid;
  const all = cells.flat().map((cell) => cell.value);
  const scale = new Scale(Math.min(0, ...all), Math.max(...all), false);
  const ratios = [
    ["Mean L", quantity(found.l_av_cd_m2)],
    found.average_to_min ? ["Mean / smallest", quantity(found.average_to_min)] : null,
    found.grid.lanes ? ["Lanes", `${found.grid.lanes.lanes} of ${number(found.grid.lanes.lane_width_m)} m, spacing ${number(found.grid.lanes.spacing_m)} m`] : null,
    found.grid.lanes ? ["Points", `${number(found.grid.lanes.along_m, 3)} m apart along, ${number(found.grid.lanes.across_m, 3)} m across; place known to ${number(found.grid.lanes.point_u_m, 2)} m from the corners`] : null,
    found.max_to_min ? ["Largest / smallest", quantity(found.max_to_min)] : null,
    found.grid_illuminance ? ["Mean illuminance", quantity(found.grid_illuminance)] : null,
  ].filter(Boolean);
  return [
    cellTable(cells, (cell) => [swatch(scale.colour(cell.value)), withUncertainty(cell.value, cell.standard_uncertainty)], { rows: found.u_l ? ["Uₗ", (index) => number(found.u_l[index].value, 3)] : null, caption: "Luminance of each cell in cd/m²" }),
    h("dl", { class: "facts across ratios" }, ratios.map((each) => figure(...each))),
  ];
}

/** A table of cells: `draw(cell)` gives what stands in each; `rows`: a last column [head, value(index)]. */
export function cellTable(cells, draw, { caption, rows = null }) {
  return h(
    "div",
    { class: "table", tabindex: "0", role: "region", "aria-label": caption },
    h(
      "table",
      { class: "cells" },
      h("caption", { class: "hidden" }, caption),
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Row"), cells[0].map((_, index) => h("th", { scope: "col", class: "number" }, String(index + 1))), rows ? h("th", { scope: "col", class: "number" }, rows[0]) : null)),
      h("tbody", {}, cells.map((line, index) => h("tr", {}, h("th", { scope: "row" }, String(index + 1)), line.map((cell) => h("td", { class: "number" }, draw(cell))), rows ? h("td", { class: "number" }, rows[1](index)) : null))),
    ),
  );
}

function swatch([red, green, blue]) {
  const mark = h("span", { class: "swatch", "aria-hidden": "true" });
  mark.style.background = `rgb(${red} ${green} ${blue})`;
  return mark;
}
