// The preview with its regions, whose corners are moved by pointer and keys.

import { svg } from "../dom.js";
import { HandleView, keep, put } from "./picture-view.js";

const KEPT = 200;

/** Regions: {name, points, closed}. Says "change" for every step, and "settled" when a step is whole. */
export class RegionEditor extends EventTarget {
  constructor() {
    super();
    this.size = [1, 1];
    this.load([]);
  }

  /** Begin with these; nothing can be undone. */
  load(regions) {
    this.regions = regions.length ? structuredClone(regions) : [{ name: "", points: [], closed: false }];
    this.active = 0;
    this.past = [];
    this.dirty = false;
    this.tell(true);
  }

  get region() {
    return this.regions[this.active];
  }

  get points() {
    return this.region.points;
  }

  clamp([x, y]) {
    const [width, height] = this.size;
    return [Math.min(Math.max(Math.round(x), 0), width), Math.min(Math.max(Math.round(y), 0), height)];
  }

  step(work) {
    this.remember();
    work();
    this.tell(true);
  }

  remember() {
    this.past.push(JSON.stringify([this.regions, this.active]));
    this.past = this.past.slice(-KEPT);
    this.dirty = true;
  }

  tell(settled = false) {
    this.dispatchEvent(new Event("change"));
    if (settled) this.dispatchEvent(new Event("settled"));
  }

  add(point) {
    this.step(() => this.points.push(this.clamp(point)));
  }

  close() {
    if (this.points.length >= 3 && !this.region.closed) this.step(() => (this.region.closed = true));
  }

  insert(index, point) {
    this.step(() => this.points.splice(index, 0, this.clamp(point)));
  }

  /** By itself no step: a drag is one, remembered when it begins. */
  move(index, point) {
    this.points[index] = this.clamp(point);
    this.tell();
  }

  nudge(index, [dx, dy]) {
    this.step(() => (this.points[index] = this.clamp([this.points[index][0] + dx, this.points[index][1] + dy])));
  }

  remove(index) {
    this.step(() => {
      this.points.splice(index, 1);
      if (this.points.length < 3) this.region.closed = false;
    });
  }

  clear() {
    this.step(() => Object.assign(this.region, { points: [], closed: false }));
  }

  rectangle() {
    this.step(() => this.span(...[0.4, 0.6].map((share) => this.size.map((side) => share * side))));
  }

  /** A rectangle between two corners; by itself no step. */
  span(...ends) {
    const [[left, right], [top, bottom]] = [0, 1].map((axis) => ends.map((end) => this.clamp(end)[axis]).sort((a, b) => a - b));
    Object.assign(this.region, { points: [[left, top], [right, top], [right, bottom], [left, bottom]], closed: true });
    this.tell();
  }

  take(regions) {
    this.step(() => {
      this.regions = regions.map(({ name, points }) => ({ name: name ?? "", points: points.map((point) => [...point]), closed: true }));
      this.active = 0;
    });
  }

  addRegion(name) {
    this.step(() => {
      this.regions.push({ name, points: [], closed: false });
      this.active = this.regions.length - 1;
    });
  }

  removeRegion(index) {
    this.step(() => {
      this.regions.splice(index, 1);
      if (!this.regions.length) this.regions.push({ name: "", points: [], closed: false });
      this.active = Math.min(this.active, this.regions.length - 1);
    });
  }

  rename(index, name) {
    this.step(() => (this.regions[index].name = name));
  }

  choose(index) {
    this.active = index;
    this.tell(true);
  }

  undo() {
    if (!this.past.length) return;
    [[this.regions, this.active], this.dirty] = [JSON.parse(this.past.pop()), this.past.length > 0];
    this.tell(true);
  }
}

const NEAR_PX = 10;

export class RegionCanvas extends HandleView {
  constructor(editor) {
    const [shade, cells] = [svg("path", { class: "roi-shade" }), svg("path", { class: "roi-cells" })];
    const [shapes, mids, handles] = [svg("g"), svg("g"), svg("g")];
    super(
      { class: "roi-canvas", "aria-label": "Region on the preview. Arrows pan, plus and minus zoom, 0 shows all; Tab goes to the corners, arrows move a corner, Insert adds one after it, Delete removes it." },
      shade, cells, shapes, mids, handles,
    );
    Object.assign(this, { editor, shade, cells, shapes, mids, handles });
    editor.addEventListener("change", () => this.draw());
  }

  show(picture) {
    this.editor.size = [picture.width, picture.height];
    super.show(picture);
  }

  showCells(lines) {
    this.cells.setAttribute("d", lines.map(([from, to]) => `M${from}L${to}`).join(""));
  }

  draw() {
    const { editor } = this;
    const points = editor.points;
    keep(this.shapes, editor.regions.length, () => svg("polygon"), (shape, i) => {
      const region = editor.regions[i];
      shape.setAttribute("points", region.points.join(" "));
      shape.setAttribute("class", `roi-shape${i === editor.active ? " active" : ""}${region.closed ? "" : " open"}`);
      shape.dataset.region = i;
    });
    const [w, h] = this.size;
    const closed = editor.regions.filter((region) => region.closed);
    this.shade.setAttribute("d", closed.length ? `M0 0H${w}V${h}H0Z${closed.map((region) => `M${region.points.join("L")}Z`).join("")}` : "");
    const edges = editor.region.closed ? points.length : 0;
    keep(this.mids, edges, () => svg("circle", { class: "roi-mid" }), (mid, i) => {
      const [x, y] = middle(points[i], points[(i + 1) % points.length]);
      put(mid, x, y, 4.5 * this.scale);
      mid.dataset.mid = i + 1;
    });
    super.draw();
  }

  knobs() {
    return this.editor.points.map((at, i, all) => ({ at, text: `Corner ${i + 1} of ${all.length}: x ${at[0]}, y ${at[1]}` }));
  }

  nudge(index, step) {
    this.editor.nudge(index, step);
  }

  grasp(event) {
    const { mid, region } = event.target.dataset;
    const held = { ...super.grasp(event), region: region === undefined ? undefined : Number(region) };
    if (mid === undefined) return held;
    this.editor.insert(Number(mid), this.at(event));
    return { ...held, point: Number(mid), remembered: true, moved: true };
  }

  carry(event) {
    const { drag, editor } = this;
    // the whole picture cannot be moved: before the first corner a drag over it draws a rectangle
    if (drag.point === undefined && this.isWhole && !editor.points.length) drag.point = "box";
    if (drag.point === undefined) return false;
    drag.remembered ||= (editor.remember(), true);
    if (drag.point === "box") editor.span(this.at(drag.from), this.at(event));
    else editor.move(drag.point, this.at(event));
    return true;
  }

  tap(event, { moved, point, region }) {
    const { editor } = this;
    if (moved) {
      if (point !== undefined) editor.tell(true);
      return;
    }
    if (event.type !== "pointerup") return;
    if (!editor.region.closed) {
      const last = editor.points.length - 1;
      // the first corner again, or the last one a second time, closes it
      if ((point === 0 || point === last) && last >= 2) editor.close();
      else if (point === undefined) this.near(event, last) && last >= 2 ? editor.close() : editor.add(this.at(event));
    } else if (region !== undefined && region !== editor.active) editor.choose(region);
  }

  near(event, index) {
    if (index < 0) return false;
    const [x, y] = this.at(event);
    return Math.hypot(x - this.editor.points[index][0], y - this.editor.points[index][1]) < NEAR_PX * this.scale;
  }

  key(event) {
    const { editor } = this;
    const index = this.handleOf(event);
    if (["Delete", "Backspace"].includes(event.key) && index !== undefined) {
      editor.remove(index);
      (this.handles.children[Math.min(index, editor.points.length - 1)] ?? this.element).focus();
    } else if (["Insert", "a"].includes(event.key) && index !== undefined) {
      editor.insert(index + 1, middle(editor.points[index], editor.points[(index + 1) % editor.points.length]));
      this.handles.children[index + 1].focus();
    } else if (event.key === "Enter") editor.close();
    else if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") editor.undo();
    else return super.key(event);
    return true;
  }
}

const middle = ([ax, ay], [bx, by]) => [Math.round((ax + bx) / 2), Math.round((ay + by) / 2)];
