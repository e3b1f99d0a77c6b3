// The frames of a card on the axis of their time, in their scenes, with a shape and a colour per ISO value.

import { h, svg } from "../dom.js";
import { roleLabel } from "../methods.js";

const [WIDE, NARROW, HEIGHT, TOP, LEFT] = [860, 330, 118, 22, 20];
const LETTER = 6.5;
const SHAPES = [
  (x, y) => svg("circle", { cx: x, cy: y, r: 4, class: "f1" }),
  (x, y) => svg("rect", { x: x - 3.6, y: y - 3.6, width: 7.2, height: 7.2, class: "f2" }),
  (x, y) => svg("path", { d: `M${x} ${y - 5}l4.6 8h-9.2z`, class: "f3" }),
  (x, y) => svg("path", { d: `M${x} ${y - 5}l5 5-5 5-5-5z`, class: "f4" }),
];
const dark = (x, y) => svg("circle", { cx: x, cy: y, r: 4, class: "dark" });
const STEPS_S = [1, 5, 15, 60, 300, 900, 3600, 14400, 86400];

/** Nothing where the frames state no times, or one alone. */
export function timeline({ scenes, frames }, checked) {
  const times = frames.map((frame) => frame.header.taken).filter(Boolean);
  const [first, last] = [Math.min(...times), Math.max(...times)];
  if (!(last > first)) return null;
  const width = innerWidth < 640 ? NARROW : WIDE;
  const isos = [...new Set(frames.map((frame) => frame.header.iso ?? 0))].sort((a, b) => a - b);
  const x = (time) => LEFT + ((time - first) / (last - first)) * (width - 2 * LEFT);
  const row = (iso) => TOP + 12 + (isos.indexOf(iso ?? 0) * 42) / Math.max(1, isos.length - 1);
  const shape = (frame) => (frame.role === "dark" ? dark : SHAPES[Math.min(isos.indexOf(frame.header.iso ?? 0), SHAPES.length - 1)]);
  const drawing = svg("svg", { class: "lanes", viewBox: `0 0 ${width} ${HEIGHT}`, role: "img", "aria-label": `${frames.length} frames on a time axis from ${clock(first, 1)} to ${clock(last, 1)}` });
  for (const scene of scenes) {
    if (!scene.from) continue;
    const [from, to] = [x(scene.from) - 9, x(scene.to) + 9];
    drawing.append(svg("rect", { x: from, y: TOP, width: to - from, height: 66, rx: 5, class: "lane" }));
    const name = scene.scene ?? roleLabel(scene.role);
    // a name that would run into the next is left to the table
    if (name.length * LETTER < Math.max(40, to - from)) drawing.append(svg("text", { class: "strong", x: (from + to) / 2, y: 14, "text-anchor": "middle" }, name));
    for (const frame of scene.frames) {
      if (!frame.header.taken) continue;
      const [at, down] = [x(frame.header.taken), row(frame.header.iso)];
      drawing.append(shape(frame)(at, down));
      if (checked.has(frame.key)) drawing.append(svg("circle", { cx: at, cy: down, r: 8.5, class: "to-check" }));
    }
  }
  drawing.append(svg("path", { class: "axis strong", d: `M${LEFT} 96H${width - LEFT}` }));
  const step = 1000 * (STEPS_S.find((each) => (last - first) / 1000 / each <= width / 96) ?? STEPS_S.at(-1));
  for (let at = Math.ceil(first / step) * step; at <= last; at += step) drawing.append(svg("path", { class: "axis strong", d: `M${x(at)} 96v4` }), svg("text", { x: x(at), y: 113, "text-anchor": "middle" }, clock(at, step)));
  const key = isos.slice(0, SHAPES.length).map((iso, at) => h("li", {}, sample(SHAPES[at]), `ISO ${iso || "not stated"}${at === SHAPES.length - 1 && isos.length > SHAPES.length ? " and above" : ""}`));
  return h("div", { class: "card lanes-card" }, drawing, h("ul", { class: "key" }, key, frames.some((frame) => frame.role === "dark") ? h("li", {}, sample(dark), "Dark") : null));
}

const sample = (draw) => svg("svg", { class: "m", viewBox: "0 0 12 12", "aria-hidden": "true" }, draw(6, 6));
const clock = (instant, step) => new Date(instant).toISOString().slice(11, step < 60000 ? 19 : 16);
