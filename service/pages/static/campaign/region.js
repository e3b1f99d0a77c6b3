// The region: drawn on a frame's preview or imported from ImageJ, set for the campaign or for one frame.

import { get, put } from "../api.js";
import { act, byId, empty, fill, h, may, toast, wrong } from "../dom.js";
import { inOrder } from "../format.js";
import { RegionCanvas, RegionEditor } from "./canvas.js";
import { keep } from "./picture-view.js";
import { select } from "../ask.js";
import { adviceOn, countOwn, holdingFor, startsEmpty } from "./state.js";
import { lookPart } from "./look.js";

const MOST_LISTED = 200;

export function regionSection(state) {
  const element = h("div");
  let tool = null;
  const draw = () => {
    // one that was refused for its region needs another
    const drawable = inOrder(state.frames.filter((frame) => frame.thumbnail), (frame) => frame.filename);
    if (tool) tool.offer(drawable);
    else if (drawable.length) fill(element, (tool = build(state, drawable)).element);
    else if (!element.firstChild) fill(element, empty("No preview yet", "The preview of the first frame appears here once it has been read."));
    note(state);
  };
  state.on("frames", draw);
  state.on("roi", draw);
  draw();
  return element;
}

function note(state) {
  const waiting = state.frames.filter((frame) => ["received", "read"].includes(frame.state)).length;
  const { said } = countOwn(state.frames);
  const shared = state.roi ? (waiting ? `${state.frames.length - waiting} of ${state.frames.length} frames computed` : "The same for every frame without its own region") : state.method.whole_frame ? "The whole frame, unless you draw a region" : said ? "" : state.method.finds_region ? "None yet: found from a panel’s code, or drawn here" : "None yet";
  byId("region-note").textContent = [shared, said].filter(Boolean).join("; ");
}

function build(state, drawable) {
  const editor = new RegionEditor();
  const canvas = new RegionCanvas(editor);
  const look = lookPart((clipping) => canvas.showClipping(clipping));
  let frame = null;
  let seen = false;
  // dark frames often come first, and nothing can be seen on them
  let chosenByHand = false;

  const frames = select([], { "aria-label": "Frame to draw on", title: "The frame whose picture is behind the region", onchange: () => take(frames.value) });
  const take = (id) => ((chosenByHand = true), choose(id));
  const step = (by) => take(frames.options[Math.min(Math.max(frames.selectedIndex + by, 0), frames.options.length - 1)].value);
  function offer(some) {
    // a list of thousands is of use to nobody: any frame is opened in the grid, and drawn on from there
    const listed = some.slice(0, MOST_LISTED);
    if (frame && !listed.some((each) => each.id === frame.id) && state.byId.has(frame.id)) listed.push(state.byId.get(frame.id));
    if (frames.options.length !== listed.length) {
      fill(frames, listed.map((each) => h("option", { value: each.id }, [each.filename, each.scene].filter(Boolean).join(" · "))));
      if (frame) frames.value = frame.id;
      const lit = some.find((each) => each.role !== "dark");
      if (frame?.role === "dark" && lit && !chosenByHand && !editor.dirty) choose(lit.id);
    }
    const now = state.byId.get(frame?.id);
    const another = now && now.roi_id !== frame.roi_id;
    frame = now ?? frame;
    if (another) load();
  }
  function choose(id) {
    frame = state.byId.get(id) ?? frame;
    if (![...frames.options].some((each) => each.value === frame.id)) frames.append(h("option", { value: frame.id }, frame.filename));
    frames.value = frame.id;
    canvas.show({ url: `/v1/frames/${frame.id}/preview.png`, width: frame.width_px, height: frame.height_px });
    settled();
    load();
  }
  function settled() {
    parts.hidden = !state.method.several_regions && editor.regions.length < 2;
    undo.disabled = editor.past.length === 0;
    saving.classList.toggle("dirty", (state.unused.region = editor.dirty));
    if (seen) look.look(frame, editor.region);
  }

  const button = (text, label, onclick) => h("button", { type: "button", title: label, "aria-label": label, onclick }, text);
  const undo = button("↶", "Undo", () => editor.undo());
  const toolbar = h("div", { class: "roi-toolbar", role: "toolbar", "aria-label": "Drawing" },
    button("+", "Zoom in", () => canvas.zoom(0.7)),
    button("−", "Zoom out", () => canvas.zoom(1 / 0.7)),
    h("button", { type: "button", onclick: () => canvas.fit() }, "All"),
    may("calibrate")
      ? [undo, h("button", { type: "button", onclick: () => (editor.rectangle(), canvas.handles.firstChild?.focus()) }, "Rectangle"), h("button", { type: "button", onclick: () => editor.clear() }, "Redraw")]
      : null,
  );
  const own = h("p", { class: "muted small" });
  const parts = partsOf(editor);
  const saving = may("calibrate") ? savePart(state, editor, () => frame) : h("div");
  /** What holds for the frame that is shown, unless somebody is drawing. */
  async function load() {
    const shown = frame;
    // how a region was found is said with the frame alone
    own.textContent = adviceOn(shown.roi_origin === "found" ? await get(`/v1/frames/${shown.id}`) : shown, state);
    if (shown.id !== frame.id) return;
    if (editor.dirty) return;
    const roi = startsEmpty(shown, state) ? null : await holdingFor(state, shown);
    if (shown.id === frame.id && !editor.dirty) editor.load(regionsOf(roi));
  }

  editor.addEventListener("settled", settled);
  state.on("roi", () => {
    if (!editor.dirty) load();
    else toast("Another user has set a region meanwhile. Yours is still here; setting it replaces the other.");
  });
  state.on("draw-on", (event) => {
    take(event.detail);
    byId("region").scrollIntoView();
    canvas.element.focus({ preventScroll: true });
  });
  const element = h("div", { class: "roi-tool" },
    h("div", { class: "roi-stage" }, h("div", { class: "roi-frame" }, button("‹", "Previous frame", () => step(-1)), frames, button("›", "Next frame", () => step(1))), canvas.element, toolbar, own),
    h("div", { class: "roi-side" }, parts, look.element, saving, imagejPart(editor)),
  );
  // nothing is computed for a region that nobody looks at
  new IntersectionObserver((entries, observer) => {
    if (!entries.some((entry) => entry.isIntersecting)) return;
    seen = true;
    observer.disconnect();
    settled();
  }).observe(canvas.element);
  offer(drawable);
  choose((drawable.find((each) => each.role !== "dark") ?? drawable[0]).id);
  return { element, offer };
}

const regionsOf = (roi) =>
  !roi ? [] : roi.regions ? inOrder(roi.regions, ({ name }) => name).map(({ name, polygon }) => ({ name, points: polygon, closed: true })) : [{ name: "", points: roi.polygon, closed: true }];

/** Its rows stay the same elements: a name that is left by a press of a button must not take the button away. */
function partsOf(editor) {
  const list = h("ul", { class: "plain" });
  const quiet = (text, onclick) => h("button", { type: "button", class: "quiet", onclick }, text);
  const at = (event) => [...list.children].indexOf(event.target.closest("li"));
  const remove = (event) => (editor.removeRegion(at(event)), list.children[editor.active].lastChild.focus());
  const make = () => h("li", {}, quiet("", (event) => editor.choose(at(event))), h("input", { onchange: (event) => editor.rename(at(event), event.target.value.trim()) }), quiet("Remove", remove));
  editor.addEventListener("settled", () => keep(list, editor.regions.length, make, (row, i) => {
    const [choose, name, away] = row.children;
    const [region, active] = [editor.regions[i], i === editor.active];
    const said = region.name || `Part ${i + 1}`;
    row.classList.toggle("active", active);
    Object.assign(choose, { textContent: active ? "●" : "○", ariaPressed: String(active), ariaLabel: `Draw ${said}` });
    Object.assign(name, { value: region.name, placeholder: said, ariaLabel: `Name of part ${i + 1}` });
    away.ariaLabel = `Remove ${said}`;
  }));
  return h("div", { class: "roi-parts" }, h("h3", {}, "Parts"), list, h("p", {}, quiet("Add a part", () => editor.addRegion(`part-${editor.regions.length + 1}`))));
}

function savePart(state, editor, frameOf) {
  const read = () => {
    const drawn = editor.regions.filter((region) => region.points.length);
    if (!drawn.length) throw wrong("Draw a region first.");
    for (const region of drawn) {
      if (!region.closed) throw wrong(`${region.name || "The region"} is not closed: click its first corner again, or press Enter.`);
    }
    if (drawn.length === 1 && !drawn[0].name) return { polygon: drawn[0].points };
    return { regions: drawn.map((region, index) => ({ name: region.name || `part-${index + 1}`, polygon: region.points })) };
  };
  const saved = async (text) => {
    Object.assign(editor, { dirty: false, past: [] });
    editor.tell(true);
    toast(text);
    await state.touch();
  };
  const forAll = async () => {
    await put(`${state.path}/roi`, read());
    const { own } = countOwn(state.frames);
    await saved(`The region is set; ${own ? `frames without their own region are recomputed, ${own} ${own === 1 ? "keeps its own" : "keep theirs"}` : "every frame is recomputed"}.`);
  };
  const forOne = async () => {
    const frame = frameOf();
    await put(`/v1/frames/${frame.id}/roi`, read());
    await saved(`${frame.filename} now has its own region.`);
  };
  return h("div", { class: "roi-save" },
    h("p", { class: "actions" }, h("button", { type: "button", class: "primary", onclick: (event) => act(event.target, forAll) }, "Use for all frames"), h("button", { type: "button", onclick: (event) => act(event.target, forOne) }, "Use for this frame")),
  );
}

// ---- lines of an ImageJ macro, and its .roi files

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
    found.push({ name: /\/\/\s*(\S.*)/.exec(after)?.[1].trim(), points: name === "makeRectangle" ? rectangle(...numbers) : numbers.flatMap((x, i) => (i % 2 ? [] : [[x, numbers[i + 1]]])) });
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

function imagejPart(editor) {
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
