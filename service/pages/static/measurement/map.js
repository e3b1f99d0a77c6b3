// A map in false colours: what lies under the pointer, or under the cross that the arrows move, is read out.

import { get } from "../api.js";
import { byId, figure, fill, h, svg } from "../dom.js";
import { number, quantity, unit, withUncertainty } from "../format.js";
import { Scale, chooseScale } from "./colours.js";
import { cellLines } from "./surface.js";

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
    cellTable(cells, (cell) => [swatch(scale.colour(cell.value)), withUncertainty(cell.value, cell.standard_uncertainty)], { rows: found.u_l ? ["Uₗ", (index) => quantity(found.u_l[index])] : null, caption: "Luminance of each cell in cd/m²" }),
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

const LABEL = "% expanded uncertainty of the value, 95 %";

export function scaleTools(views) {
  const { unit } = views[0].map;
  const show = (logarithmic) => {
    const scale = chooseScale(views.map((view) => view.map.squares), { unit, logarithmic });
    for (const view of views) view.show(scale);
    const notes = byId("layer-notes");
    if (notes) fill(notes);
  };
  show(unit !== "1");
  const kinds = unit === "1" ? [["Values", () => show(false)]] : [["Logarithmic", () => show(true)], ["Linear", () => show(false)]];
  if (views.length === 1 && views[0].map.uncertainty) kinds.push(["Uncertainty", () => showUncertainty(views[0])]);
  if (kinds.length === 1) return null;
  const buttons = kinds.map(([text, draw], at) =>
    h("button", { type: "button", "aria-pressed": String(!at), onclick: (event) => {
      for (const each of buttons) each.setAttribute("aria-pressed", String(each === event.target));
      draw();
    } }, text),
  );
  return h("div", { class: "segments", role: "group", "aria-label": "Colours" }, buttons);
}

/** The relative expanded uncertainty of each square, where there is light. */
async function showUncertainty(view) {
  const { map } = view;
  map.layer ??= get(`/v1/measurements/${map.id}/map.json?step=${map.step}&layer=expanded_uncertainty_rel`);
  const { values, notes } = await map.layer;
  const shares = values.map((line) => line.map((value) => (value === null ? null : 100 * value)));
  view.show(chooseScale([shares], { unit: "%", logarithmic: true }), shares, LABEL);
  const of = map.step > 1 ? `Of the mean over squares of ${map.step} px; a single pixel has more.` : "Of single pixels.";
  fill(byId("layer-notes"), [of, ...notes].map((note) => h("li", {}, note)));
}

const HIGHEST = "75vh";
const STEPS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

export class MapView {
  /** `region`: points [x, y]; `grid`: corners, rows, columns, where there is one. */
  constructor(map, { region, grid, name = "Map" }) {
    this.map = map;
    this.place = [Math.floor(map.height / 2), Math.floor(map.width / 2)];
    this.canvas = h("canvas", { width: map.squares[0].length, height: map.squares.length, "aria-hidden": "true" });
    this.cross = svg("path", { class: "map-cross", visibility: "hidden" });
    this.over = svg(
      "svg",
      { class: "map-over", viewBox: `0 0 ${map.width} ${map.height}`, tabindex: "0", role: "application", "aria-label": `${name}: arrow keys move the cross, ten pixels at a time with Shift` },
      ...outlines(region, grid),
      this.cross,
    );
    this.said = h("output", { class: "map-said", "aria-live": "polite" }, "Point at the map to read a value.");
    this.bar = h("div", { class: "map-bar" });
    this.stage = h("div", { class: "map-stage" }, this.canvas, this.over);
    this.element = h("div", { class: "map" }, this.stage, this.said, this.bar);
    this.stage.style.aspectRatio = `${map.width} / ${map.height}`;
    // a low window makes it narrower, and not flatter: what lies over it stays in its place
    this.stage.style.width = `min(100%, ${HIGHEST} * ${map.width / map.height})`;
    this.listen();
  }

  /** Lay what is drawn on over the map, hidden. */
  cover(element) {
    this.cloth = element;
    element.toggleAttribute("hidden", true);
    this.stage.append(element);
  }

  uncover(on) {
    this.cloth.toggleAttribute("hidden", !on);
    this.over.toggleAttribute("hidden", on);
    if (on) fill(this.said, "Click corners on the map, or start with a rectangle and move its corners with Tab and the arrow keys.");
  }

  /** Paint the squares, or another layer of as many, in the colours of a scale. */
  show(scale, squares = this.map.squares, label = this.map.unit === "1" ? "" : unit(this.map.unit)) {
    const { canvas, map } = this;
    const painter = canvas.getContext("2d");
    const picture = painter.createImageData(canvas.width, canvas.height);
    let at = 0;
    for (const line of squares) {
      for (const value of line) {
        const [red, green, blue] = scale.colour(value);
        picture.data.set([red, green, blue, 255], at);
        at += 4;
      }
    }
    painter.putImageData(picture, 0, 0);
    canvas.classList.toggle("coarse", map.width < 800);
    fill(this.bar, drawBar(scale, squares, label, map));
    canvas.toBlob((blob) => {
      URL.revokeObjectURL(this.picture);
      this.picture = URL.createObjectURL(blob);
      this.onpaint?.();
    });
  }

  listen() {
    const { over, map } = this;
    over.addEventListener("pointermove", (event) => this.look(this.under(event)));
    over.addEventListener("pointerdown", (event) => this.look(this.under(event)));
    over.addEventListener("pointerleave", () => this.cross.setAttribute("visibility", "hidden"));
    over.addEventListener("focus", () => over.matches(":focus-visible") && this.look(this.place));
    over.addEventListener("keydown", (event) => {
      const step = STEPS[event.key];
      if (!step) return;
      event.preventDefault();
      const far = event.shiftKey ? 10 : 1;
      this.look([clamp(this.place[0] + step[0] * far, map.height), clamp(this.place[1] + step[1] * far, map.width)]);
    });
  }

  under({ clientX, clientY }) {
    const box = this.over.getBoundingClientRect();
    const { map } = this;
    return [clamp(Math.floor(((clientY - box.top) / box.height) * map.height), map.height), clamp(Math.floor(((clientX - box.left) / box.width) * map.width), map.width)];
  }

  /** Read a pixel: the square it lies in at once, its own value as soon as it is there. */
  async look([row, col]) {
    this.place = [row, col];
    const arm = Math.max(this.map.width, this.map.height) / 60;
    this.cross.setAttribute("d", `M${col + 0.5 - arm} ${row + 0.5}h${2 * arm}M${col + 0.5} ${row + 0.5 - arm}v${2 * arm}`);
    this.cross.setAttribute("visibility", "visible");
    if (this.map.step > 1) this.say(row, col, this.map.square(row, col), "about ");
    clearTimeout(this.waiting);
    this.waiting = setTimeout(async () => {
      try {
        const value = await this.map.pixel(row, col);
        if (this.place[0] === row && this.place[1] === col) this.say(row, col, value);
      } catch (error) {
        if (!error.code) throw error;
        fill(this.said, error.message);
      }
    }, this.map.step > 1 ? 60 : 0);
  }

  say(row, col, value, about = "") {
    const u = this.map.uncertaintyOf(value);
    const figure = value === null ? unknownOf(this.map) : `${about}${u === undefined ? number(value) : withUncertainty(value, u)} ${this.map.unit === "1" ? "" : unit(this.map.unit)}`;
    fill(this.said, h("strong", {}, figure.trim()), h("span", { class: "muted" }, ` at x ${col}, y ${row}`));
    this.said.dataset.value = value === null ? "" : String(value);
  }
}

const clamp = (place, size) => Math.min(Math.max(place, 0), size - 1);
const unknownOf = (map) => (map.unit === "1" ? "no value here" : "saturated: above the measurable range");

function outlines(region, grid) {
  const shapes = [svg("polygon", { class: "map-region back", points: region.join(" ") }), svg("polygon", { class: "map-region", points: region.join(" ") })];
  if (grid) shapes.push(svg("path", { class: "map-cells", d: cellLines(grid).map(([from, to]) => `M${from}L${to}`).join("") }));
  return shapes;
}

function drawBar(scale, squares, label, map) {
  const strip = h("canvas", { width: 256, height: 1, "aria-hidden": "true" });
  const painter = strip.getContext("2d");
  const picture = painter.createImageData(256, 1);
  for (let index = 0; index < 256; index += 1) {
    const share = (index + 0.5) / 256;
    const value = scale.logarithmic ? scale.low * (scale.high / scale.low) ** share : scale.low + (scale.high - scale.low) * share;
    picture.data.set([...scale.colour(value), 255], 4 * index);
  }
  painter.putImageData(picture, 0, 0);
  const ticks = scale.ticks().map((tick) => {
    const label = h("span", {}, number(tick, 3));
    label.style.left = `${100 * scale.share(tick)}%`;
    return label;
  });
  const unknown = squares.some((line) => line.includes(null));
  return [
    h("div", { class: "map-strip" }, strip, h("div", { class: "map-ticks" }, ticks)),
    h("span", { class: "muted small" }, label),
    unknown ? h("span", { class: "small nowrap" }, h("span", { class: "map-unknown", "aria-hidden": "true" }), map.unit === "1" || squares !== map.squares ? "no value" : "saturated") : null,
  ];
}
