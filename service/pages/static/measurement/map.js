// A map in false colours: what lies under the pointer, or under the cross that the arrows move, is read out.

import { get } from "../api.js";
import { arrowOf } from "../campaign/picture-view.js";
import { byId, figure, fill, h, segments, svg, table } from "../dom.js";
import { number, quantity, unit, withUncertainty } from "../format.js";
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
  const columns = [
    { head: "Row", header: true, cell: (line) => String(cells.indexOf(line) + 1) },
    ...cells[0].map((_, index) => ({ head: String(index + 1), class: "number", cell: (line) => draw(line[index]) })),
    ...(rows ? [{ head: rows[0], class: "number", cell: (line) => rows[1](cells.indexOf(line)) }] : []),
  ];
  return table(columns, cells, { caption, kind: "cells" });
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
  return segments("Colours", kinds.map(([text, draw]) => [draw, text]), kinds[0][1], (draw) => draw());
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

export class MapView {
  /** `region`: points [x, y]; `grid`: corners, rows, columns, where there is one. */
  constructor(map, { region, grid, name = "Map" }) {
    this.map = map;
    this.canvas = h("canvas", { width: map.squares[0].length, height: map.squares.length, "aria-hidden": "true" });
    this.probe = probe([map.width, map.height], ([col, row]) => this.look([row, col]), name, ...outlines(region, grid));
    this.over = this.probe.element;
    this.said = h("output", { class: "map-said", "aria-live": "polite" }, "Point at the map to read a value.");
    this.bar = h("div", { class: "map-bar" });
    this.stage = h("div", { class: "map-stage" }, this.canvas, this.over);
    this.element = h("div", { class: "map" }, this.stage, this.said, this.bar);
    this.stage.style.aspectRatio = `${map.width} / ${map.height}`;
    // a low window makes it narrower, and not flatter: what lies over it stays in its place
    this.stage.style.width = `min(100%, ${HIGHEST} * ${map.width / map.height})`;
  }

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

  /** Read a pixel: the square it lies in at once, its own value as soon as it is there. */
  async look([row, col]) {
    this.place = [row, col];
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

/** A cross over a picture of so many pixels, moved by pointer and arrows: `look([col, row])` reads what lies under it. */
export function probe(size, look, name, ...layers) {
  const cross = svg("path", { class: "map-cross", visibility: "hidden" });
  const element = svg("svg", { class: "map-over", viewBox: `0 0 ${size.join(" ")}`, tabindex: "0", role: "application", "aria-label": `${name}: arrow keys move the cross, ten pixels at a time with Shift` }, ...layers, cross);
  const arm = Math.max(...size) / 60;
  let place = size.map((each) => each / 2);
  const go = (to) => {
    place = to.map((each, axis) => Math.min(Math.max(Math.floor(each), 0), size[axis] - 1));
    const [x, y] = place.map((each) => each + 0.5);
    cross.setAttribute("d", `M${x - arm} ${y}h${2 * arm}M${x} ${y - arm}v${2 * arm}`);
    cross.setAttribute("visibility", "visible");
    look(place);
  };
  const point = ({ clientX, clientY }) => {
    const box = element.getBoundingClientRect();
    go([((clientX - box.left) / box.width) * size[0], ((clientY - box.top) / box.height) * size[1]]);
  };
  for (const name of ["pointermove", "pointerdown"]) element.addEventListener(name, point);
  element.addEventListener("pointerleave", () => cross.setAttribute("visibility", "hidden"));
  element.addEventListener("focus", () => element.matches(":focus-visible") && go(place));
  element.addEventListener("keydown", (event) => {
    const step = arrowOf(event);
    if (!step) return;
    event.preventDefault();
    go(place.map((each, axis) => each + step[axis]));
  });
  return { element, cross };
}

const unknownOf = (map) => (map.unit === "1" ? "no value here" : "saturated: above the measurable range");

function outlines(region, grid) {
  const shapes = [svg("polygon", { class: "map-region back", points: region.join(" ") }), svg("polygon", { class: "map-region", points: region.join(" ") })];
  if (grid) shapes.push(svg("path", { class: "map-cells", d: cellLines(grid).map(([from, to]) => `M${from}L${to}`).join("") }));
  return shapes;
}

export function drawBar(scale, squares, label, map) {
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

const MOST = 120000;
const PIECE = 32;

export async function loadMap(measurement, { width_px: width, height_px: height }) {
  const step = Math.max(1, Math.ceil(Math.sqrt((width * height) / MOST)));
  const squares = await get(`/v1/measurements/${measurement.id}/map.json?step=${step}`);
  return new MapValues(measurement.id, squares);
}

export class MapValues {
  constructor(id, { values, step, unit, width_px: width, height_px: height, uncertainty }) {
    Object.assign(this, { id, squares: values, step, unit, width, height, uncertainty, pieces: new Map() });
  }

  /** The mean of the square that a pixel lies in; null where it is unknown. */
  square(row, col) {
    const line = this.squares[Math.min(Math.floor(row / this.step), this.squares.length - 1)];
    return line[Math.min(Math.floor(col / this.step), line.length - 1)];
  }

  /** The very value of a pixel, as in map.tif; asks for the pixels around it too. */
  async pixel(row, col) {
    if (this.step === 1) return this.square(row, col);
    const [top, left] = [row, col].map((place) => Math.floor(place / PIECE) * PIECE);
    const key = `top=${top}&left=${left}`;
    if (!this.pieces.has(key)) {
      const asked = get(`/v1/measurements/${this.id}/map.json?${key}&height=${PIECE}&width=${PIECE}`);
      this.pieces.set(key, asked);
      asked.catch(() => this.pieces.delete(key));
    }
    const { values } = await this.pieces.get(key);
    return values[row - top][col - left];
  }

  /** The standard uncertainty of a pixel's value; undefined where no rule is known. */
  uncertaintyOf(value) {
    if (!this.uncertainty || value === null) return undefined;
    const { u_rel: relative, u_constant: constant, u_pixel: noise } = this.uncertainty;
    return Math.hypot(relative * value, constant, noise);
  }
}

// every fifteenth of the 256 colours of the picture
export const ANCHORS = [
  "#1a0034", "#2c0042", "#40004d", "#560054", "#6d0058", "#810e57", "#951e55", "#a82d51", "#ba3d4b",
  "#ca4e45", "#d8603c", "#e57334", "#ef872c", "#f79c27", "#fdb22c", "#ffc83f", "#ffde58", "#fff467",
];
const UNKNOWN = [0, 200, 255];
const parts = (hex) => [1, 3, 5].map((at) => Number.parseInt(hex.slice(at, at + 2), 16));

const TABLE = Array.from({ length: 256 }, (_, index) => {
  const place = Math.min(index / 15, ANCHORS.length - 1);
  const low = Math.floor(place);
  const [from, to] = [parts(ANCHORS[low]), parts(ANCHORS[Math.min(low + 1, ANCHORS.length - 1)])];
  return from.map((part, channel) => Math.round(part + (to[channel] - part) * (place - low)));
});

/** From values to shares of the colours, and what to write beside the bar. */
export class Scale {
  constructor(low, high, logarithmic) {
    Object.assign(this, { low, high, logarithmic });
  }

  share(value) {
    const { low, high } = this;
    if (!this.logarithmic) return (value - low) / (high - low);
    return value > 0 ? Math.log(value / low) / Math.log(high / low) : 0;
  }

  colour(value) {
    if (value === null) return UNKNOWN;
    return TABLE[Math.min(Math.max(Math.floor(this.share(value) * 256), 0), 255)];
  }

  /** Round numbers within: 1, 2, 5, 10, ... or even steps. */
  ticks() {
    const { low, high } = this;
    if (this.logarithmic && high / low > 3) {
      const decades = Array.from({ length: Math.ceil(Math.log10(high)) - Math.floor(Math.log10(low)) + 1 }, (_, index) => Math.floor(Math.log10(low)) + index);
      const steps = high / low < 1e3 ? [1, 2, 5] : [1];
      return decades.flatMap((decade) => steps.map((step) => Number((step * 10 ** decade).toPrecision(3)))).filter((tick) => tick >= low * 0.999 && tick <= high * 1.001);
    }
    const rough = (high - low) / 4;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].find((each) => each * power >= rough) * power;
    const ticks = [];
    for (let tick = Math.ceil(low / step) * step; tick <= high + step / 1e6; tick += step) ticks.push(Number(tick.toPrecision(6)));
    return ticks;
  }
}

/** From the 0.5th to the 99.9th percentile of what is above zero, evenly from 0 to the 99th: lamps are few. A reflectance has 0 to 1, an index -1 to 1. */
function chooseScale(planes, { unit, logarithmic }) {
  const all = planes.flat(2).filter((value) => value !== null);
  if (unit === "1") return new Scale(percentile(all, 0.005) < -0.01 ? -1 : 0, 1, false);
  const lit = all.filter((value) => value > 0);
  if (!lit.length) return new Scale(0.1, 1, logarithmic);
  if (!logarithmic) return new Scale(0, percentile(lit, 0.99), false);
  let [low, high] = [percentile(lit, 0.005), percentile(lit, 0.999)];
  const missing = 0.3 - Math.log10(high / low);
  if (missing > 0) [low, high] = [low / 10 ** (missing / 2), high * 10 ** (missing / 2)];
  return new Scale(low, high, true);
}

function percentile(values, share) {
  if (!values.length) return 0;
  const sorted = Float64Array.from(values).sort();
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];
}
