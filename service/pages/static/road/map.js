// The map of an evaluation from above: what lies under its lines, and a probe that reads E, U and L.

import { get, post } from "../api.js";
import { byId, fill, h, segments, toggle } from "../dom.js";
import { fixed, groupBy, number, percent, withUncertainty } from "../format.js";
import { Scale, drawBar, probe } from "../measurement/map.js";
import { placed } from "../measurement/surface.js";

const LONG_PX = 900;
const BESIDE = [40, 42, 46];
const GROUNDS = [["e", "E"], ["u", "Uncertainty"], ["picture", "Picture"]];
const LAYERS = [["isolux", "Isolux"], ["grid", "Grid"], ["points", "Points"]];
const shown = new Set(LAYERS.map(([name]) => name));
const phone = matchMedia("(max-width: 40rem)");
let ground = "e";

export const axisOf = (points, axis) => [...new Set(points.map((each) => each[axis]))].sort((a, b) => a - b);

/** Reads the grid at any place of its parts: ln E, its relative uncertainty and L are linear between four points; undefined beside them. */
export function gridReader(points, { across_m: narrow }) {
  const judged = points.filter(({ part }) => !part.endsWith(" (inside)"));
  const parts = [...groupBy(judged, ({ part }) => part).values()].map((mine) => ({ axes: ["x_m", "y_m"].map((axis) => axisOf(mine, axis)), at: new Map(mine.map((each) => [`${each.x_m} ${each.y_m}`, each])) }));
  return (...place) => {
    for (const { axes, at } of parts) {
      const [x, y] = axes.map((axis, i) => between(axis, place[i], narrow));
      const found = x && y && x.flatMap(([along, a]) => y.map(([across, b]) => [at.get(`${along} ${across}`), a * b])).filter(([each, share]) => each && share > 0);
      const whole = found ? found.reduce((sum, [, share]) => sum + share, 0) : 0;
      if (whole < 0.5) continue;
      const mean = (of) => found.reduce((sum, [each, share]) => sum + share * of(each), 0) / whole;
      return { lux: Math.exp(mean((each) => Math.log(each.illuminance_lx))), u_rel: mean((each) => each.u_rel), luminance: mean((each) => each.luminance_cd_m2 ?? NaN) };
    }
    return undefined;
  };
}

/** The two places of an axis around a value, each with its share; half a step beyond the last is its own. */
function between(axis, value, narrow) {
  const step = axis.length > 1 ? axis[1] - axis[0] : narrow;
  if (value < axis[0] - step / 2 || value > axis.at(-1) + step / 2) return null;
  const at = Math.min(Math.max(Math.floor((value - axis[0]) / step), 0), Math.max(axis.length - 2, 0));
  const share = Math.min(Math.max((value - axis[at]) / step, 0), 1);
  return [[axis[at], 1 - share], [axis[at + 1] ?? axis[at], share]];
}

export function drawMap(result) {
  const { x_m: [x0, x1], y_m: [y0, y1], lx } = result.map;
  const read = gridReader(result.points, result.grid);
  const said = h("output", { class: "map-said", "aria-live": "polite" }, "Point at the map to read E and L.");
  const bar = h("div", { class: "map-bar" });
  const stage = h("div", { class: "map-stage" });
  fill(byId("map"), stage, said, bar, h("p", { class: "caption" }, `Ring: the minimum. Heavy line: limit of the class. Placed to ± ${number(result.grid.place_u_m, 2)} m; at most ${number(result.grid.place_limit_m, 2)} m is allowed. ${result.grid.points - result.grid.hidden} of ${result.grid.points} points visible.`));
  const layer = ([name, text]) => toggle(text, (on) => (on ? shown.add(name) : shown.delete(name), paint()), shown.has(name));
  fill(byId("layers"), segments("Ground", GROUNDS, ground, (name) => ((ground = name), paint())), h("div", { class: "segments", role: "group", "aria-label": "Show" }, LAYERS.map(layer)));
  phone.onchange = paint;
  return paint();

  async function paint() {
    const upright = phone.matches;
    const long = [LONG_PX, Math.round((LONG_PX * (y1 - y0)) / (x1 - x0))];
    const size = upright ? long.reverse() : long;
    const roadAt = ([col, row]) => {
      const [along, across] = upright ? [1 - row / size[1], col / size[0]] : [col / size[0], row / size[1]];
      return [x0 + along * (x1 - x0), y0 + across * (y1 - y0)];
    };
    const look = ([col, row]) => say(...roadAt([col + 0.5, row + 0.5]));
    const layers = [...(ground === "e" ? ["e"] : []), ...shown].join(",") || "none";
    const under = h("canvas", { width: size[0], height: size[1], "aria-hidden": "true" });
    const lines = h("img", { class: "road-map", src: `/plots/roads/${result.road_id}/${result.number}?layers=${layers}&upright=${upright}`, alt: "The road from above, with lanes, luminaires, grid and control points; the tables below hold the same figures" });
    stage.style.aspectRatio = size.join(" / ");
    fill(stage, under, lines, probe(size, look, "Map of the road").element);
    const percents = result.points.map(({ u_rel: u }) => 200 * u);
    const shares = new Scale(0.9 * Math.min(...percents), 1.1 * Math.max(...percents), false);
    if (ground === "picture") fill(bar, h("span", { class: "muted small" }, result.frames[0].filename));
    else fill(bar, ground === "e" ? drawBar(new Scale(...lx, true), [[]], "lx", {}) : drawBar(shares, [[]], "% expanded uncertainty of E, k = 2", {}));
    if (ground === "e") return;
    const colour = ground === "picture" ? await pictureReader(result) : (place) => gridColour(read(...place), shares);
    const painter = under.getContext("2d");
    const picture = painter.createImageData(...size);
    for (let row = 0, at = 0; row < size[1]; row += 1) {
      for (let col = 0; col < size[0]; col += 1, at += 4) picture.data.set([...colour(roadAt([col + 0.5, row + 0.5])), 255], at);
    }
    painter.putImageData(picture, 0, 0);
  }

  function say(x, y) {
    const found = read(x, y);
    const where = h("span", { class: "muted" }, ` at ${fixed(x, 1)} m along, ${fixed(y, 1)} m across`);
    if (!found) return fill(said, "No grid here", where);
    const { lux, u_rel: u, luminance } = found;
    return fill(said, h("strong", {}, `${withUncertainty(lux, 2 * u * lux)} lx`), ` (k = 2, ${percent(2 * u)})${luminance ? `, L ${number(luminance, 3)} cd/m²` : ""}`, where);
  }
}

const gridColour = (found, shares) => (found ? shares.colour(200 * found.u_rel) : BESIDE);

async function pictureReader(result) {
  const [{ frame_id: id }] = result.frames;
  const road = await get(`/v1/roads/${result.road_id}`);
  const { marks } = road.frames.find((each) => each.frame_id === id) ?? road.frames[0];
  const [answer, frame] = await Promise.all([post(`/v1/roads/${road.id}/placement`, { frame_id: id, marks }), get(`/v1/frames/${id}`)]);
  const image = h("img", { src: `/v1/frames/${id}/preview.png` });
  await image.decode();
  const [width, height] = [image.naturalWidth, image.naturalHeight];
  const painter = h("canvas", { width, height }).getContext("2d");
  painter.drawImage(image, 0, 0);
  const { data } = painter.getImageData(0, 0, width, height);
  const lens = placed(answer);
  return (place) => {
    const [x, y] = lens.toImage(place);
    const [col, row] = [Math.floor((x * width) / frame.width_px), Math.floor((y * height) / frame.height_px)];
    return col >= 0 && row >= 0 && col < width && row < height ? data.slice(4 * (row * width + col), 4 * (row * width + col) + 3) : BESIDE;
  };
}
