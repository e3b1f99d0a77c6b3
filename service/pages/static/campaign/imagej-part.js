// Regions as lines of an ImageJ macro, and from its .roi files.

import { act, h, may, wrong } from "../dom.js";

const TYPES = { polygon: 0, rectangle: 1, freehand: 7, traced: 8 };
const SUBPIXEL = 128;
const HEADER = 64;

/** Corners and names of every makePolygon(...) or makeRectangle(...) in a text: [{name?, points}]. */
function readMacro(text) {
  const found = [];
  for (const [, name, inside, after] of text.matchAll(/\b(makePolygon|makeRectangle)\s*\(([^()]*)\)\s*;?([^\n]*)/g)) {
    const numbers = inside.split(",").map((part) => (part.trim() === "" ? NaN : Number(part)));
    if (numbers.some((number) => !Number.isFinite(number))) throw wrong(`${name} contains a value that is not a number: ${inside.trim().slice(0, 60)}`);
    if (name === "makeRectangle" && numbers.length !== 4) throw wrong("makeRectangle wants four numbers: x, y, width, height.");
    if (name === "makePolygon" && (numbers.length < 6 || numbers.length % 2)) throw wrong("makePolygon wants three corners or more, each with its x and its y.");
    found.push({ name: /\/\/\s*(\S.*)/.exec(after)?.[1].trim(), points: name === "makeRectangle" ? rectangle(...numbers) : pairs(numbers) });
  }
  if (!found.length) throw wrong("The text contains no makePolygon(...) or makeRectangle(...).");
  return found;
}

/** A line a region; the name of one of several stands behind it as a comment. */
const writeMacro = (regions) => regions.map(({ name, points }) => `makePolygon(${points.flat().join(",")});${name ? ` // ${name}` : ""}`).join("\n");

function readRoi(buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength < HEADER || view.getUint32(0) !== 0x496f7574) throw wrong("This is not an ImageJ .roi file. Unpack a RoiSet.zip first.");
  const [version, type, top, left, bottom, right] = [view.getInt16(4), view.getUint8(6), view.getInt16(8), view.getInt16(10), view.getInt16(12), view.getInt16(14)];
  const [count, options] = [view.getUint16(16), view.getUint16(50)];
  const fine = (options & SUBPIXEL) !== 0;
  const name = readName(view, version);
  if (type === TYPES.rectangle) {
    const [x, y, width, height] = [18, 22, 26, 30].map((at) => view.getFloat32(at));
    return { name, points: fine && version >= 223 && width > 0 ? rectangle(x, y, width, height) : rectangle(left, top, right - left, bottom - top) };
  }
  if (![TYPES.polygon, TYPES.freehand, TYPES.traced].includes(type)) throw wrong("The region is not a polygon: ovals, lines and points have no corners. Draw it as a polygon in ImageJ.");
  const whole = HEADER + 4 * count;
  if (count < 3 || buffer.byteLength < (fine && version >= 222 ? whole + 8 * count : whole)) throw wrong("The .roi file is incomplete.");
  const points = Array.from({ length: count }, (_, i) =>
    fine && version >= 222
      ? [view.getFloat32(whole + 4 * i), view.getFloat32(whole + 4 * (count + i))]
      : [left + view.getInt16(HEADER + 2 * i), top + view.getInt16(HEADER + 2 * (count + i))],
  );
  return { name, points };
}

function readName(view, version) {
  const second = view.getUint32(60);
  if (version < 218 || !second || second + 24 > view.byteLength) return undefined;
  const [at, length] = [view.getUint32(second + 16), view.getUint32(second + 20)];
  if (!at || !length || at + 2 * length > view.byteLength) return undefined;
  return String.fromCharCode(...Array.from({ length }, (_, i) => view.getUint16(at + 2 * i)));
}

const rectangle = (x, y, width, height) => [[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
const pairs = (numbers) => numbers.flatMap((x, i) => (i % 2 ? [] : [[x, numbers[i + 1]]]));

export function imagejPart(editor) {
  const text = h("textarea", { class: "mono", rows: "3", spellcheck: "false", "aria-label": "ImageJ macro", "aria-describedby": "imagej-hint", placeholder: "makePolygon(2200,1600,3100,1600,3100,2300,2200,2300);" });
  const show = () => {
    if (document.activeElement !== text) text.value = writeMacro(editor.regions.filter((region) => region.closed));
  };
  editor.addEventListener("settled", show);
  show();
  const inside = (regions) => {
    const [width, height] = editor.size;
    for (const { points } of regions) {
      const out = points.find(([x, y]) => x < 0 || y < 0 || x > width || y > height);
      if (out) throw wrong(`The corner (${out.join(", ")}) lies outside the frame of ${width} × ${height} pixels.`);
    }
    editor.take(regions);
  };
  const files = h("input", { type: "file", hidden: true, multiple: true, accept: ".roi,.ijm,.txt", "aria-label": "ImageJ file", onchange: () => act(open, load) });
  async function load() {
    const regions = [];
    for (const file of files.files) {
      const data = await file.arrayBuffer();
      const found = file.name.toLowerCase().endsWith(".roi") ? [readRoi(data)] : readMacro(new TextDecoder().decode(data));
      regions.push(...found.map((region, index) => ({ ...region, name: region.name ?? (files.files.length + found.length > 2 ? `${file.name.replace(/\.\w+$/, "")}${index || ""}` : "") })));
    }
    files.value = "";
    inside(regions.length === 1 ? [{ ...regions[0], name: "" }] : regions);
  }
  const open = h("button", { type: "button", onclick: () => files.click() }, "Open .roi or macro");
  return h("details", { class: "imagej" },
    h("summary", {}, "ImageJ: macro and .roi"),
    h("p", { class: "hint", id: "imagej-hint" }, "Lines of ImageJ’s macro recorder, makePolygon or makeRectangle, in pixels of the frame. A line is a part of the region."),
    text,
    h("p", { class: "actions" }, may("calibrate") ? [h("button", { type: "button", onclick: (event) => act(event.target, async () => inside(readMacro(text.value))) }, "Use this macro"), open, files] : null),
  );
}
