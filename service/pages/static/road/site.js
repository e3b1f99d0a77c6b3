// A road over a picture of it: the marks that place the picture, and the site, moved by pointer, by keys or by what is typed.

import { get, patch, post } from "../api.js";
import { numberOf, optionsOf } from "../ask.js";
import { HandleView } from "../campaign/picture-view.js";
import { small } from "../causes.js";
import { act, byId, fill, h, may, segments, svg, toast, wrong } from "../dom.js";
import { groupBy, number } from "../format.js";
import { placed } from "../measurement/surface.js";
import { FEWEST_MARKS, addFrame, cornersOf } from "./list.js";

const PAUSE_MS = 200;
const AROUND_M = 5;
const PIECES = 24;
const ROW = [["y_m", "across [m]"], ["first_x_m", "first at [m]"], ["spacing_m", "spacing [m]"], ["height_m", "height [m]"]];
const STRIP = [["y_m", "near edge [m]"], ["width_m", "width [m]"]];
const MARK = [["x_px", "column [px]"], ["y_px", "row [px]"], ["x_m", "along [m]"], ["y_m", "across [m]"]];
const cm = (value) => Math.round(100 * value) / 100;
const farOf = (strip) => strip.y_m + strip.width_m;

/** The field of a site [m]: from one luminaire to the next, over its strips. */
function fieldOf({ rows: [first], strips = [] }) {
  const start = first.first_x_m ?? 0;
  const lanes = strips.filter(({ kind }) => kind === "lane");
  const edges = (lanes.length ? lanes : strips).flatMap((strip) => [strip.y_m, farOf(strip)]);
  return { x: [start, start + first.spacing_m], y: edges.length ? [Math.min(...edges), Math.max(...edges)] : [0, 6] };
}

const areasOf = (site) => (site.areas ?? []).filter(({ corners_m: corners }) => corners.length);

/** [class, places on the road] of each line of a site. */
function linesOf(site) {
  const { x: [start, end], y: [near, far] } = fieldOf(site);
  const edges = (site.strips ?? []).flatMap((strip) => [strip.y_m, farOf(strip)].map((y) => [strip.kind === "lane" && (y === near || y === far) ? "site-edge" : "site-lane", [[start - AROUND_M, y], [end + AROUND_M, y]]]));
  const areas = areasOf(site).map(({ corners_m: corners }) => ["site-edge", [...corners, corners[0]]]);
  return [...edges, ...areas, ["site-field", [[start, near], [end, near], [end, far], [start, far], [start, near]]]];
}

/** What is named over the picture, [text, place]. */
const namesOf = (site) => [...(site.strips ?? []).map((strip) => [strip.name, [fieldOf(site).x[0], strip.y_m + strip.width_m / 2]]), ...areasOf(site).map((area) => [area.name, area.corners_m[0]])];

const lampsOf = (site) => {
  const [low, high] = [fieldOf(site).x[0] - AROUND_M, fieldOf(site).x[1] + AROUND_M];
  return site.rows.flatMap(({ first_x_m: first = 0, spacing_m: spacing, y_m: y }) => {
    const from = Math.ceil((low - first) / spacing);
    return Array.from({ length: Math.max(Math.floor((high - first) / spacing) - from + 1, 0) }, (_, at) => [first + (from + at) * spacing, y]);
  });
};

/** `tool`: {handles(), seen() [lens, site], begin(), settle(), add(place)}; a handle is {text, at, move(place)} in pixels. */
class SiteCanvas extends HandleView {
  constructor(tool) {
    const [lines, names, handles] = [svg("g"), svg("g", { class: "map-isolines" }), svg("g")];
    super({ class: "roi-canvas", "aria-label": "The road in the picture. Arrows pan, plus and minus zoom, 0 shows all; Tab goes to the handles, arrows move one by a pixel, with Shift by ten." }, lines, names, handles);
    Object.assign(this, { tool, lines, names, handles });
  }

  knobs() {
    return this.tool.handles();
  }

  draw() {
    const [lens, site] = this.tool?.seen() ?? [];
    if (!site) return;
    const path = ([name, places]) => {
      const fine = places.slice(1).flatMap((to, i) => Array.from({ length: PIECES + 1 }, (_, n) => places[i].map((from, axis) => from + ((to[axis] - from) * n) / PIECES)));
      return svg("path", { class: name, d: `M${fine.map(lens.toImage).join("L")}` });
    };
    const lamp = (place) => {
      const [cx, cy] = lens.toImage(place);
      return svg("circle", { class: "site-lamp", cx, cy, r: 4 * this.scale });
    };
    const name = ([text, place]) => {
      const [x, y] = lens.toImage(place);
      const drawn = svg("text", { class: "site-name", x: x + 14 * this.scale, y, "font-size": 13 * this.scale, "stroke-width": 3 * this.scale });
      drawn.append(text);
      return drawn;
    };
    this.lines.replaceChildren(...(lens ? [...linesOf(site).map(path), ...lampsOf(site).map(lamp)] : []));
    this.names.replaceChildren(...(lens ? namesOf(site).map(name) : []));
    super.draw();
  }

  carry(event) {
    const { drag, tool } = this;
    if (drag.point === undefined) return false;
    if (!drag.handle) tool.begin();
    drag.handle ??= tool.handles()[drag.point];
    drag.handle.move(this.at(event));
    this.draw();
    return true;
  }

  tap(event, { moved, point }) {
    if (moved && point !== undefined) this.tool.settle();
    else if (!moved && point === undefined && event.type === "pointerup") this.tool.add(this.at(event));
  }

  nudge(point, step) {
    const { at, move } = this.tool.handles()[point];
    this.tool.begin();
    move(at.map((each, axis) => each + step[axis]));
    this.tool.settle();
  }
}

/** Fill the section `site`; `changed()` after what is drawn was saved. Answers what saves it, where it was changed. */
export function drawSite(road, changed) {
  let draft = structuredClone({ site: road.site, frames: road.frames });
  let frame = null;
  let kind = "marks";
  let lens = null;
  let waiting;
  // the area whose corners are touched one after another
  let drawn = null;
  const past = [];
  const mine = may("calibrate");
  let proposed = []; // places [px] of marks that a person is to move
  const unmoved = () => draft.frames.flatMap((each) => each.marks ?? []).filter((mark) => proposed.includes(`${mark.x_px},${mark.y_px}`)).length;
  const marks = () => draft.frames.find((each) => each.frame_id === frame?.id)?.marks ?? [];
  const tool = {
    handles: () => (!mine || !frame ? [] : kind === "marks" ? marks().map(markHandle) : lens ? siteHandles(draft.site, lens) : []),
    seen: () => [lens, draft.site],
    begin: () => past.push(JSON.stringify(draft)),
    settle,
    add(place) {
      if (!mine || !frame) return;
      const area = draft.site.areas?.find(({ name }) => name === drawn);
      if (kind === "marks") change(() => marks().push(newMark(place)));
      else if (area && lens) change(() => area.corners_m.push(lens.toRoad(place).map(cm)));
    },
  };
  const canvas = new SiteCanvas(tool);
  const told = h("p", { role: "status", class: "small" });
  const fields = h("div", { class: "site-fields" });
  const frames = h("select", { title: "The frame whose picture is shown", "aria-label": "Frame", onchange: () => choose(frames.value) });
  const button = (text, onclick, more = {}) => h("button", { type: "button", onclick, ...more }, text);
  const undo = button("Undo", () => ((draft = JSON.parse(past.pop())), settle()));
  const save = button("Save", (event) => act(event.target, keep), { class: "primary" });
  const adds = {
    marks: [button("Remove this frame", () => change(() => (draft.frames = draft.frames.filter((each) => each.frame_id !== frame.id))))],
    site: [["lane", "Add a lane"], ["walkway", "Add a walkway"], ["area", "Add an area"]].map(([name, text]) => button(text, () => change(() => addPart(name)))),
  };
  const tools = h("div", { class: "roi-toolbar", role: "toolbar", "aria-label": "Drawing" });
  const kinds = segments("Move", [["marks", "Marks"], ["site", "Site"]], kind, turn);
  fill(byId("site-tools"), frames, mine ? button("Add a frame…", addAnother) : null, kinds);
  fill(byId("site"), canvas.element, tools, told, fields, mine ? h("p", { class: "actions" }, undo, save) : null);
  list();
  turn(kind);
  if (draft.frames.length) choose(draft.frames[0].frame_id);
  else fill(told, "The road has no frames: add one, and mark points of the road in it.");
  return async () => past.length && keep();

  async function list() {
    const named = await Promise.all(draft.frames.map(({ frame_id: id }) => get(`/v1/frames/${id}`)));
    fill(frames, optionsOf(named.map(({ id, filename }) => [id, filename]), frame?.id));
  }

  async function choose(id) {
    frame = await get(`/v1/frames/${id}`);
    // one that is placed by its own position has none
    draft.frames.find((each) => each.frame_id === id).marks ??= [];
    canvas.show({ url: `/v1/frames/${id}/preview.png`, width: frame.width_px, height: frame.height_px });
    settle();
  }

  /** Four corners of the field to begin with, each to be moved to its place. */
  async function addAnother() {
    const chosen = await addFrame(road);
    if (!chosen) return;
    const { x, y } = fieldOf(draft.site);
    const pixels = [[0.3, 0.3], [0.7, 0.3], [0.7, 0.7], [0.3, 0.7]].map(([u, v]) => [Math.round(u * chosen.width_px), Math.round(v * chosen.height_px)]);
    proposed = pixels.map(String);
    if (!draft.frames.some((each) => each.frame_id === chosen.id)) change(() => draft.frames.push({ frame_id: chosen.id, marks: cornersOf(x, y, pixels) }));
    kinds.firstChild.click();
    await choose(chosen.id);
    await list();
  }

  function turn(chosen) {
    kind = chosen;
    drawn = null;
    fill(tools, mine ? adds[kind] : null, button("Fit to view", () => canvas.fit()));
    settle();
  }

  function change(work, typed = false) {
    tool.begin();
    work();
    settle(typed);
  }

  /** A step is whole: draw it, write its figures unless one was typed, and place the picture again. */
  function settle(typed = false) {
    undo.disabled = !past.length;
    save.disabled = !past.length || unmoved() > 0;
    canvas.draw();
    if (drawn && kind === "site") fill(told, "Touch the corners of the area one after another.");
    if (mine && !typed) fill(fields, kind === "marks" ? marks().map((mark, at) => figures(`Mark ${at + 1}`, mark, MARK, () => marks().splice(at, 1))) : siteFields());
    clearTimeout(waiting);
    if (frame) waiting = setTimeout(place, PAUSE_MS);
  }

  async function place() {
    const asked = { frame_id: frame.id, marks: marks() };
    const text = JSON.stringify(asked);
    const latest = () => text === JSON.stringify({ frame_id: frame.id, marks: marks() });
    try {
      if (asked.marks.length < FEWEST_MARKS) throw wrong(`Touch ${FEWEST_MARKS} points or more of the road that surround the field, and type where each is.`);
      const answer = await post(`/v1/roads/${road.id}/placement`, asked);
      if (!latest()) return;
      lens = placed(answer);
      fill(told, unmoved() ? `Move each mark to its place in the picture: ${unmoved()} of ${asked.marks.length} are left.` : `Placed by ${asked.marks.length} marks, to ± ${number(answer.place_u_m, 2)} m.`);
    } catch (error) {
      if (!error.code) throw error;
      if (!latest()) return;
      lens = null;
      fill(told, error.message);
    }
    canvas.draw();
  }

  function newMark([x, y]) {
    const [along, across] = lens ? lens.toRoad([x, y]).map(cm) : [0, 0];
    return { x_px: Math.round(x), y_px: Math.round(y), x_m: along, y_m: across };
  }

  /** A lane or walkway beside the last one; an area of which no corner is set yet. */
  function addPart(part) {
    const { site } = draft;
    const names = [...(site.strips ?? []), ...(site.areas ?? [])].map((each) => each.name);
    const free = (stem, from) => (names.includes(`${stem}${from}`) ? free(stem, from + 1) : `${stem}${from}`);
    if (part === "area") {
      (site.areas ??= []).push({ name: (drawn = free("area ", 1)), corners_m: [] });
      return;
    }
    const same = site.strips?.filter(({ kind: each }) => part === "walkway" || each === part) ?? [];
    (site.strips ??= []).push({ name: free(part === "lane" ? "" : `${part} `, 1), kind: part, y_m: Math.max(0, ...same.map(farOf)), width_m: part === "lane" ? (same[0]?.width_m ?? 3.5) : 2 });
  }

  function figures(name, of, keys, remove) {
    const entry = ([key, label]) => {
      const input = h("input", { type: "number", step: "any", "data-keep": `${name} ${key}`, value: cm(of[key] ?? 0), title: `${name}: ${label}`, onchange: (event) => act(event.target, async () => change(((value) => () => (of[key] = value))(numberOf(input) ?? 0), true)) });
      return h("label", { class: "site-entry" }, label, input);
    };
    return h("div", { class: "site-row", role: "group", "aria-label": name }, h("strong", {}, name), keys.map(entry), remove ? small("Remove", () => change(remove), { "aria-label": `Remove ${name}` }) : null);
  }

  function siteFields() {
    const { site } = draft;
    const without = (list, each) => () => list.splice(list.indexOf(each), 1);
    return [
      site.rows.map((row, at) => figures(`Luminaires ${at + 1}`, row, ROW, site.rows.length > 1 ? without(site.rows, row) : null)),
      (site.strips ?? []).map((strip) => figures(strip.kind === "lane" ? `Lane ${strip.name}` : strip.name, strip, STRIP, without(site.strips, strip))),
      (site.areas ?? []).map((area) => area.corners_m.map((corner, at) => figures(`${area.name}, corner ${at + 1}`, corner, [[0, "along [m]"], [1, "across [m]"]], area.corners_m.length > 3 ? without(area.corners_m, corner) : at ? null : without(site.areas, area)))),
    ];
  }

  async function keep() {
    if (unmoved()) throw wrong("Move each mark to its place in the picture first, or undo.");
    const areas = (draft.site.areas ?? []).filter(({ corners_m: corners }) => corners.length > 2);
    await patch(`/v1/roads/${road.id}`, { site: { ...draft.site, areas }, frames: draft.frames.map(({ marks: set, ...each }) => (set?.length ? { ...each, marks: set } : each)) });
    past.length = 0;
    settle();
    toast("Saved. Evaluate the road for its new figures.");
    await changed();
  }
}

const markHandle = (mark, at) => ({
  text: `Mark ${at + 1}: ${mark.x_m}, ${mark.y_m} m, at x ${mark.x_px}, y ${mark.y_px}`,
  at: [mark.x_px, mark.y_px],
  move: ([x, y]) => Object.assign(mark, { x_px: Math.round(x), y_px: Math.round(y) }),
});

/** Rows of luminaires, edges of strips (one where two lanes meet) and corners of areas. */
function siteHandles(site, lens) {
  const { x: [start, end] } = fieldOf(site);
  const edges = (site.strips ?? []).flatMap((strip) => [{ strip, y: strip.y_m }, { strip, y: farOf(strip), far: true }]);
  const together = [...groupBy(edges, ({ strip, y }) => `${strip.kind === "lane" ? "lane" : strip.name} ${y.toFixed(3)}`).values()];
  return [
    ...site.rows.map((row, at) => ({
      text: `Luminaires ${at + 1}: ${row.first_x_m ?? 0}, ${row.y_m} m`,
      at: lens.toImage([row.first_x_m ?? 0, row.y_m]),
      move: (place) => ([row.first_x_m, row.y_m] = lens.toRoad(place).map(cm)),
    })),
    ...together.map((some) => ({
      text: `Edge of ${some.map(({ strip }) => strip.name).join(" and ")}: ${cm(some[0].y)} m`,
      at: lens.toImage([(start + end) / 2, some[0].y]),
      move(place) {
        const y = cm(lens.toRoad(place)[1]);
        for (const { strip, far } of some) Object.assign(strip, far ? { width_m: cm(y - strip.y_m) } : { y_m: y, width_m: cm(farOf(strip) - y) });
      },
    })),
    ...(site.areas ?? []).flatMap((area) => area.corners_m.map((corner, at) => ({
      text: `${area.name}, corner ${at + 1}: ${corner.join(", ")} m`,
      at: lens.toImage(corner),
      move: (place) => corner.splice(0, 2, ...lens.toRoad(place).map(cm)),
    }))),
  ];
}
