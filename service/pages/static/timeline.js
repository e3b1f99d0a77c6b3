// Frames on the axis of their time, in the brackets of their scenes, with a shape and a colour per ISO value; readings below them.

import { fill, h, svg } from "./dom.js";
import { counted, natural, number, shortly, unit } from "./format.js";
import { roleLabel } from "./methods.js";

const [WIDE, NARROW, LEFT] = [860, 316, 20];
const [LANE, READINGS] = [66, 18];
const [LETTER, NAME, MOST_ROWS, MOST_LETTERS] = [6.5, 14, 3, 24];
const SHAPES = [
  (x, y) => svg("circle", { cx: x, cy: y, r: 4, class: "f1" }),
  (x, y) => svg("rect", { x: x - 3.6, y: y - 3.6, width: 7.2, height: 7.2, class: "f2" }),
  (x, y) => svg("path", { d: `M${x} ${y - 5}l4.6 8h-9.2z`, class: "f3" }),
  (x, y) => svg("path", { d: `M${x} ${y - 5}l5 5-5 5-5-5z`, class: "f4" }),
];
const dark = (x, y) => svg("circle", { cx: x, cy: y, r: 4, class: "dark" });
const readingMark = (x, y) => svg("path", { d: `M${x - 4} ${y - 4}l8 8m0-8l-8 8`, class: "reading-at" });
const [PAUSE_MS, GAP] = [1800e3, 44]; // a pause this long, and longer than all between shorter ones, is drawn as a gap of so many px
const STEPS_S = [1, 5, 15, 60, 300, 900, 3600, 14400, 86400];

/**
 * `scenes` [{scene, role, frames, from, to}] of `frames` [{header: {taken, iso}, role, key}]; nothing where they state no times,
 * or one alone. `checked`: keys of frames to check. `readings` [{at, text}]. `regroup(frames, scene)` moves frames to a scene,
 * without a name to a new one: then the edges of brackets are moved.
 */
export function timeline({ scenes, frames }, { checked = new Set(), readings = [], regroup } = {}) {
  const times = [...frames.map((frame) => frame.header.taken), ...readings.map((each) => each.at)].filter(Boolean);
  const [first, last] = times.reduce(([low, high], each) => [Math.min(low, each), Math.max(high, each)], [Infinity, -Infinity]);
  if (!(last > first) || !frames.some((frame) => frame.header.taken)) return null;
  const width = innerWidth < 640 ? NARROW : WIDE;
  const isos = [...new Set(frames.map((frame) => frame.header.iso ?? 0))].sort((a, b) => a - b);
  const parts = partsOf(times, width);
  const x = (time) => { const { from, to, at, wide } = parts.findLast((part) => time >= part.from) ?? parts[0]; return at + (to > from ? Math.min(1, (time - from) / (to - from)) * wide : wide / 2); };
  const timeAt = (across) => { const { from, to, at, wide } = parts.findLast((part) => across >= part.at) ?? parts[0]; return from + Math.min(1, Math.max(0, (across - at) / wide)) * (to - from); };
  const timed = scenes.filter((scene) => scene.from).sort((a, b) => a.from - b.from);
  const names = placeNames(timed, { x, width });
  const top = 8 + NAME * (1 + Math.max(0, ...names.map((each) => each.row)));
  const row = (iso) => top + 12 + (isos.indexOf(iso ?? 0) * 42) / Math.max(1, isos.length - 1);
  const shape = (frame) => (frame.role === "dark" ? dark : SHAPES[Math.min(isos.indexOf(frame.header.iso ?? 0), SHAPES.length - 1)]);
  const bottom = top + LANE + (readings.length ? READINGS : 0) + 8;
  const drawing = svg("svg", { class: "lanes", viewBox: `0 0 ${width} ${bottom + (day(first) === day(last) ? 22 : 36)}`, role: regroup ? "group" : "img", "aria-label": `${counted(frames.length, "frame")}${readings.length ? ` and ${counted(readings.length, "reading")}` : ""} on a time axis from ${day(first)} ${clock(first, 1)} to ${clock(last, 1)}` });
  timed.forEach((scene, at) => {
    const { name, text, middle, row: above } = names[at];
    const [from, to] = [x(scene.from) - 9, x(scene.to) + 9];
    drawing.append(svg("rect", { x: from, y: top, width: to - from, height: LANE, rx: 5, class: "lane" }, svg("title", {}, `${name}, ${counted(scene.frames.length, "frame")}`)));
    if (above > 0) drawing.append(svg("path", { class: "axis", d: `M${(from + to) / 2} ${top}v${4 - NAME * above}` }));
    if (above >= 0) drawing.append(svg("text", { class: "strong", x: middle, y: top - 8 - NAME * above, "text-anchor": "middle" }, text));
  });
  // thousands that fall on each other are drawn once
  const drawn = new Set();
  for (const frame of timed.flatMap((scene) => scene.frames).filter((each) => each.header.taken)) {
    const [at, down] = [x(frame.header.taken), row(frame.header.iso)];
    if (checked.has(frame.key)) drawing.append(svg("circle", { cx: at, cy: down, r: 8.5, class: "to-check" }));
    const place = `${Math.round(2 * at)} ${down} ${frame.role === "dark"}`;
    if (!drawn.has(place)) drawing.append(shape(frame)(at, down));
    drawn.add(place);
  }
  for (const { at, text } of readings) {
    const drawnReading = readingMark(x(at), top + LANE + 10);
    drawnReading.append(svg("title", {}, text));
    drawing.append(drawnReading);
  }
  const dated = day(first) !== day(last);
  const mostTicks = Math.ceil(width / 64);
  for (const { from, to, at, wide } of parts) {
    drawing.append(svg("path", { class: "axis strong", d: `M${at} ${bottom}h${wide}` }));
    const step = 1000 * (STEPS_S.find((each) => (to - from) / 1000 / each <= wide / 96) ?? STEPS_S.at(-1));
    const ticks = Array.from({ length: mostTicks }, (_, count) => (Math.ceil(from / step) + count) * step).filter((time) => time <= to);
    for (const [count, time] of (ticks.length ? ticks : [from]).entries()) drawing.append(svg("path", { class: "axis strong", d: `M${x(time)} ${bottom}v4` }), svg("text", { x: x(time), y: bottom + 17, "text-anchor": "middle" }, clock(time, step)), dated && !count ? svg("text", { x: at + wide / 2, y: bottom + 31, "text-anchor": "middle" }, day(time)) : "");
  }
  if (regroup) for (const scene of timed.filter((each) => each.scene !== undefined)) drawing.append(...["Start", "End"].map((side) => edgeOf(scene, side, { x, top, timeAt, drawing, regroup, others: timed })));
  const key = isos.slice(0, SHAPES.length).map((iso, at) => h("li", {}, sample(SHAPES[at]), `ISO ${iso || "not stated"}${at === SHAPES.length - 1 && isos.length > SHAPES.length ? " and above" : ""}`));
  return h("div", { class: "card lanes-card" }, drawing, h("ul", { class: "key" }, key, frames.some((frame) => frame.role === "dark") ? h("li", {}, sample(dark), "Dark") : null, readings.length ? h("li", {}, sample(readingMark), "Meter reading") : null));
}

/** The axis in parts {from, to, at, wide} between long pauses, which would leave no room for the frames. */
function partsOf(times, width) {
  const ordered = [...times].sort((a, b) => a - b);
  const pauses = ordered.slice(1).map((time, at) => ({ ends: time, long: time - ordered[at] })).sort((a, b) => a.long - b.long);
  let between = 0;
  const gaps = new Set();
  for (const { ends, long } of pauses) if (long >= PAUSE_MS && long > between) gaps.add(ends);
    else between += long;
  const runs = ordered.reduce((found, time) => (found.length && !gaps.has(time) ? ((found.at(-1).to = time), found) : [...found, { from: time, to: time }]), []);
  const room = width - 2 * LEFT - GAP * (runs.length - 1);
  const least = Math.min(60, room / runs.length / 2);
  let at = LEFT;
  return runs.map(({ from, to }) => {
    const wide = least + (room - least * runs.length) * (between ? (to - from) / runs.reduce((sum, run) => sum + run.to - run.from, 0) || 0 : 1 / runs.length);
    at += wide + GAP;
    return { from, to, at: at - wide - GAP, wide };
  });
}

/**
 * Where the name of each bracket is written: over its middle, in the lowest row that is free there. A bracket without
 * room in any row is named where it is pointed at, and in the table.
 */
function placeNames(timed, { x, width }) {
  const ends = Array(MOST_ROWS).fill(0);
  return timed.map((scene) => {
    const name = scene.scene ?? roleLabel(scene.role);
    const text = shortly(name, MOST_LETTERS);
    const half = (text.length * LETTER) / 2;
    const middle = Math.min(width - half, Math.max(half, (x(scene.from) + x(scene.to)) / 2));
    const row = ends.findIndex((end) => middle - half >= end);
    if (row >= 0) ends[row] = middle + half + LETTER;
    return { name, text, middle, row };
  });
}

/**
 * The start or the end of a bracket: dragged, or moved with the arrows by a frame. Outwards it takes the frames that it
 * passes, inwards it leaves those behind it to a new scene.
 */
function edgeOf(scene, side, { x, top, timeAt, drawing, regroup, others }) {
  const ends = side === "End";
  const beyond = (time, other) => (ends ? time > other : time < other);
  const inTurn = (some) => (ends ? some.sort(byTime) : some.sort(byTime).reverse());
  const at = ends ? x(scene.to) + 9 : x(scene.from) - 9;
  const own = inTurn(scene.frames.filter((frame) => frame.header.taken));
  const limit = ends ? scene.to : scene.from;
  const near = inTurn(others.filter((each) => each !== scene && each.scene !== undefined && each.role === scene.role).flatMap((each) => each.frames).filter((frame) => beyond(frame.header.taken, limit)));
  const [outward, inward] = ends ? ["right takes the next frame", "left begins a new scene with the last"] : ["left takes the frame before", "right begins a new scene with the first"];
  const label = `${side} of ${scene.scene}, ${counted(own.length, "frame")}: ${outward}, ${inward}`;
  // the end in the upper half, the start in the lower: those of neighbours do not cover each other
  const foot = ends ? top : top + LANE / 2;
  const edge = svg("g", { class: "edge", tabindex: "0", role: "button", "aria-label": label, "data-keep": `${side} ${scene.scene}` }, svg("rect", { x: at - 12, y: foot, width: 24, height: LANE / 2 }), svg("path", { d: `M${at} ${foot + 5}v${LANE / 2 - 10}` }));
  const end = (time) => {
    const taken = near.filter((frame) => !beyond(frame.header.taken, time));
    const left = own.filter((frame) => beyond(frame.header.taken, time));
    if (taken.length) regroup(taken, scene.scene);
    else if (left.length && left.length < own.length) regroup(left);
  };
  const timeOf = (event) => timeAt(new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse()).x);
  edge.addEventListener("pointerdown", (event) => {
    edge.setPointerCapture(event.pointerId);
    const moved = (now) => edge.setAttribute("transform", `translate(${x(timeOf(now)) - at} 0)`);
    const over = new AbortController();
    edge.addEventListener("pointermove", moved, { signal: over.signal });
    for (const name of ["pointerup", "pointercancel"])
      edge.addEventListener(name, (last) => {
        over.abort();
        edge.removeAttribute("transform");
        if (name === "pointerup" && Math.abs(last.clientX - event.clientX) > 3) end(timeOf(last));
      }, { signal: over.signal });
  });
  edge.addEventListener("keydown", (event) => {
    if (event.key === (ends ? "ArrowRight" : "ArrowLeft") && near.length) end(near[0].header.taken);
    else if (event.key === (ends ? "ArrowLeft" : "ArrowRight") && own.length > 1) end(own.at(-2).header.taken);
    else return;
    event.preventDefault();
  });
  return edge;
}

/** Frames in the order of their time, in a bracket for each run of one role and scene: a scene that is returned to has several. */
export function bracketsOf(frames) {
  const runs = [];
  for (const frame of frames.filter((each) => each.header.taken).sort(byTime)) {
    const run = runs.at(-1);
    const same = run && run.role === frame.role && run.scene === (frame.scene ?? undefined);
    if (same) run.frames.push(frame);
    else runs.push({ role: frame.role, scene: frame.scene ?? undefined, frames: [frame], from: frame.header.taken });
    runs.at(-1).to = frame.header.taken;
  }
  return runs;
}

const byTime = (a, b) => a.header.taken - b.header.taken || natural(String(a.key), String(b.key));
const sample = (draw) => svg("svg", { class: "m", viewBox: "0 0 12 12", "aria-hidden": "true" }, draw(6, 6));
const day = (instant) => new Date(instant).toISOString().slice(0, 10);
const clock = (instant, step) => new Date(instant).toISOString().slice(11, step < 60000 ? 19 : 16);

/** What was assumed of the clocks of these frames; "" where all are known without. */
export function assumed(frames, campaign) {
  const zones = [...new Set(frames.filter((frame) => frame.time_zone || !frame.instant).map((frame) => frame.time_zone))];
  return zones.map((zone) => (zone ? `The camera’s clock states no time zone and is read as ${zone}, as the ${campaign.time_zone ? "campaign" : "organisation"} states; drawn in UTC.` : "The camera’s clock states no time zone and is drawn as UTC: frames may lie hours from readings. State the campaign’s time zone with its details.")).join(" ");
}

export function inTimePart(state) {
  const place = h("div");
  const fold = h("details", { class: "fold in-time", ontoggle: () => draw() }, h("summary", {}, "In time ", h("span", { class: "muted" }, "scenes, frames and meter readings")), place);
  let before = "";
  function draw() {
    const known = state.frames.filter((frame) => frame.taken_at);
    const readings = (state.book?.readings ?? []).filter((each) => !each.withdrawn_at && each.taken_at);
    fold.hidden = !known.length;
    const shown = JSON.stringify([known.map((frame) => [frame.id, frame.scene, frame.role, frame.outcome, frame.instant]), readings.map((each) => each.id)]);
    if (!fold.open || shown === before) return;
    before = shown;
    const frames = known.map((frame) => ({ key: frame.id, role: frame.role, scene: frame.scene, header: { taken: Date.parse(frame.instant ?? `${frame.taken_at}Z`), iso: frame.iso } }));
    const marks = readings.map((each) => ({ at: Date.parse(each.taken_at), text: `${each.scene}: ${number(each.value, 5)} ${unit(each.unit)}, ${each.taken_at.slice(11, 16)} UTC` }));
    const checked = new Set(known.filter((frame) => ["warn", "fail"].includes(frame.outcome)).map((frame) => frame.id));
    const untimed = state.frames.length - known.length;
    const silent = (state.book?.readings ?? []).filter((each) => !each.withdrawn_at && !each.taken_at).length;
    const notes = [
      assumed(known, state.campaign),
      untimed ? `Frames without a time: ${untimed}.` : "",
      silent ? `Readings without a time: ${silent}.` : "",
    ].filter(Boolean);
    fill(place, timeline({ scenes: bracketsOf(frames), frames }, { checked, readings: marks }) ?? h("p", { class: "muted" }, "All frames have one time."), notes.length ? h("p", { class: "small muted" }, notes.join(" ")) : null);
  }
  for (const name of ["frames", "campaign"]) state.on(name, draw);
  state.book?.addEventListener("change", draw);
  draw();
  return fold;
}
