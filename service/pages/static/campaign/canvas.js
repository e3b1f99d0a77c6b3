// The preview with its regions, whose corners are moved by pointer and keys.

import { svg } from "../dom.js";
import { PictureView } from "./picture-view.js";
import { middle } from "./polygon.js";

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
    this.future = [];
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
    this.future = [];
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
    const [width, height] = this.size;
    const at = (x, y) => this.clamp([width * x, height * y]);
    this.step(() => Object.assign(this.region, { points: [at(0.4, 0.4), at(0.6, 0.4), at(0.6, 0.6), at(0.4, 0.6)], closed: true }));
  }

  /** Take these points as the region, such as of a file. */
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
    this.travel(this.past, this.future);
  }

  redo() {
    this.travel(this.future, this.past);
  }

  travel(from, to) {
    if (!from.length) return;
    to.push(JSON.stringify([this.regions, this.active]));
    [this.regions, this.active] = JSON.parse(from.pop());
    this.tell(true);
  }
}

const NEAR_PX = 10;

export class RegionCanvas extends PictureView {
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

  /** Lines over the picture, each from one point to another. */
  showCells(lines) {
    this.cells.setAttribute("d", lines.map(([from, to]) => `M${from}L${to}`).join(""));
  }

  draw() {
    const { editor } = this;
    const unit = this.scale;
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
      place(mid, x, y, 4.5 * unit);
      mid.dataset.mid = i + 1;
    });
    keep(this.handles, points.length, newHandle, (handle, i) => {
      const [x, y] = points[i];
      place(handle.firstChild, x, y, 18 * unit);
      place(handle.lastChild, x, y, 6.5 * unit);
      handle.dataset.point = i;
      handle.setAttribute("aria-label", `Corner ${i + 1} of ${points.length}: x ${x}, y ${y}`);
    });
  }

  grasp(event) {
    const handle = event.target.closest("[data-point]");
    const { mid, region } = event.target.dataset;
    const held = { region: region === undefined ? undefined : Number(region) };
    if (handle) Object.assign(held, { point: Number(handle.dataset.point) });
    else if (mid !== undefined) {
      this.editor.insert(Number(mid), this.at(event));
      Object.assign(held, { point: Number(mid), remembered: true, moved: true });
    }
    if (handle) handle.focus();
    else this.element.focus({ preventScroll: true });
    return held;
  }

  carry(event) {
    const { drag, editor } = this;
    if (drag.point === undefined) return false;
    if (!drag.remembered) editor.remember();
    drag.remembered = true;
    editor.move(drag.point, this.at(event));
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
    const index = event.target.closest("[data-point]") ? Number(event.target.closest("[data-point]").dataset.point) : null;
    const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    const by = event.shiftKey ? 10 : 1;
    if (arrow && index !== null) editor.nudge(index, arrow.map((each) => each * by));
    else if (["Delete", "Backspace"].includes(event.key) && index !== null) {
      editor.remove(index);
      (this.handles.children[Math.min(index, editor.points.length - 1)] ?? this.element).focus();
    } else if (["Insert", "a"].includes(event.key) && index !== null) {
      editor.insert(index + 1, middle(editor.points[index], editor.points[(index + 1) % editor.points.length]));
      this.handles.children[index + 1].focus();
    } else if (event.key === "Enter") editor.close();
    else if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") event.shiftKey ? editor.redo() : editor.undo();
    else if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "y") editor.redo();
    else return super.key(event);
    return true;
  }
}

const newHandle = () =>
  svg("g", { class: "roi-handle", tabindex: "0", role: "button" }, svg("circle", { class: "roi-grip" }), svg("circle", { class: "roi-dot" }));

function place(circle, x, y, r) {
  circle.setAttribute("cx", x);
  circle.setAttribute("cy", y);
  circle.setAttribute("r", r);
}

/** As many children as there are, each redrawn; those that stay keep their focus. */
function keep(group, count, make, draw) {
  while (group.children.length > count) group.lastChild.remove();
  while (group.children.length < count) group.append(make());
  [...group.children].forEach(draw);
}
