// A picture that is zoomed and moved: by wheel, drag, pinch and keys.

import { svg } from "../dom.js";

const CLOSEST = 1 / 40;
const STILL_PX = 4;

const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

/** The step of an arrow key, [x, y], ten times as far with Shift; undefined for other keys. */
export const arrowOf = ({ key, shiftKey }) => ARROWS[key]?.map((each) => each * (shiftKey ? 10 : 1));

/** `layers` lie over the picture, in pixels of the frame. Subclasses take what is grasped, carried, tapped or typed. */
export class PictureView {
  constructor(attributes, ...layers) {
    this.picture = svg("image", { preserveAspectRatio: "none" });
    this.clipped = svg("g", { class: "roi-clipped" });
    this.element = svg("svg", { tabindex: "0", role: "application", ...attributes }, this.picture, this.clipped, ...layers);
    this.pointers = new Map();
    this.size = [3, 2];
    this.box = [0, 0, 3, 2];
    new ResizeObserver(() => this.draw()).observe(this.element);
    const { element } = this;
    element.addEventListener("pointerdown", (event) => this.down(event));
    element.addEventListener("pointermove", (event) => this.moved(event));
    for (const name of ["pointerup", "pointercancel"]) element.addEventListener(name, (event) => this.up(event));
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(Math.min(Math.max(event.deltaY, -120), 120) / 300), this.at(event));
    }, { passive: false });
    element.addEventListener("keydown", (event) => this.key(event) && event.preventDefault());
  }

  /** Of a frame: its preview and its size. The place stays where another of the same size was shown. */
  show({ url, width, height }) {
    const same = this.size[0] === width && this.size[1] === height;
    this.size = [width, height];
    this.picture.setAttribute("href", url);
    this.picture.setAttribute("width", width);
    this.picture.setAttribute("height", height);
    this.element.style.aspectRatio = `${width} / ${height}`;
    this.showClipping(null);
    if (!same) this.fit();
    this.draw();
  }

  showClipping(clipping) {
    const { col0_px: x, row0_px: y, cell_px: side, cells } = clipping ?? { cells: [] };
    this.clipped.replaceChildren(...cells.map((cell) => svg("rect", { x: x + cell.col * side, y: y + cell.row * side, width: side, height: side, opacity: 0.35 + 0.6 * cell.share })));
  }

  /** Drawn again where the place, the size or the content is another. */
  draw() {}

  fit() {
    this.look([0, 0, ...this.size]);
  }

  get isWhole() {
    return this.box[2] >= this.size[0];
  }

  /** Frame pixels per pixel of the screen. */
  get scale() {
    const { width, height } = this.element.getBoundingClientRect();
    return Math.max(this.box[2] / (width || 1), this.box[3] / (height || 1));
  }

  look([x, y, width, height]) {
    const [w, h] = this.size;
    const share = Math.min(Math.max(width / w, CLOSEST), 1);
    const [bw, bh] = [w * share, h * share];
    this.box = [Math.min(Math.max(x + (width - bw) / 2, 0), w - bw), Math.min(Math.max(y + (height - bh) / 2, 0), h - bh), bw, bh];
    this.element.setAttribute("viewBox", this.box.join(" "));
    this.draw();
  }

  zoom(factor, [cx, cy] = this.centre()) {
    const [x, y, width, height] = this.box;
    const share = Math.min(Math.max((width * factor) / this.size[0], CLOSEST), 1) / (width / this.size[0]);
    this.look([cx - (cx - x) * share, cy - (cy - y) * share, width * share, height * share]);
  }

  pan(dx, dy) {
    const [x, y, width, height] = this.box;
    this.look([x + dx, y + dy, width, height]);
  }

  centre() {
    const [x, y, width, height] = this.box;
    return [x + width / 2, y + height / 2];
  }

  at({ clientX, clientY }) {
    const point = new DOMPoint(clientX, clientY).matrixTransform(this.element.getScreenCTM().inverse());
    return [point.x, point.y];
  }

  /** What is pressed, for `carry` and `tap`. */
  grasp() {
    this.element.focus({ preventScroll: true });
    return {};
  }

  carry() {
    return false;
  }

  tap() {}

  down(event) {
    if (event.button > 0) return;
    this.element.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, event);
    this.drag = this.pointers.size > 1 ? { pinch: true } : { from: event, ...this.grasp(event) };
  }

  moved(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before || !this.drag) return;
    if (this.drag.pinch) {
      this.pinch(event);
    } else if (this.drag.moved || Math.hypot(event.clientX - this.drag.from.clientX, event.clientY - this.drag.from.clientY) > STILL_PX) {
      if (!this.carry(event)) this.pan((before.clientX - event.clientX) * this.scale, (before.clientY - event.clientY) * this.scale);
      this.drag.moved = true;
    }
    this.pointers.set(event.pointerId, event);
  }

  pinch(event) {
    const others = [...this.pointers.values()].filter((each) => each.pointerId !== event.pointerId);
    const [other, before] = [others[0], this.pointers.get(event.pointerId)];
    const gap = (a) => Math.hypot(a.clientX - other.clientX, a.clientY - other.clientY) || 1;
    const centre = { clientX: (event.clientX + other.clientX) / 2, clientY: (event.clientY + other.clientY) / 2 };
    this.zoom(gap(before) / gap(event), this.at(centre));
    this.pan(((before.clientX - event.clientX) * this.scale) / 2, ((before.clientY - event.clientY) * this.scale) / 2);
  }

  up(event) {
    if (!this.pointers.delete(event.pointerId) || !this.drag || this.pointers.size) return;
    const drag = this.drag;
    this.drag = null;
    if (!drag.pinch) this.tap(event, drag);
  }

  /** Whether the key has done something. */
  key(event) {
    const arrow = ARROWS[event.key];
    if (event.ctrlKey || event.metaKey || event.altKey) return false;
    if (arrow) this.pan(arrow[0] * this.box[2] * 0.1, arrow[1] * this.box[3] * 0.1);
    else if (["+", "="].includes(event.key)) this.zoom(0.8);
    else if (event.key === "-") this.zoom(1.25);
    else if (event.key === "0") this.fit();
    else return false;
    return true;
  }
}

/** A picture with handles that pointer and arrows move: a subclass has `knobs()`, [{text, at}], and what moves one. */
export class HandleView extends PictureView {
  draw() {
    const knobs = this.knobs();
    keep(this.handles, knobs.length, newHandle, (handle, i) => {
      const [x, y] = knobs[i].at;
      put(handle.firstChild, x, y, 18 * this.scale);
      put(handle.lastChild, x, y, 6.5 * this.scale);
      handle.dataset.point = i;
      handle.setAttribute("aria-label", knobs[i].text);
    });
  }

  handleOf(event) {
    const handle = event.target.closest("[data-point]");
    return handle ? Number(handle.dataset.point) : undefined;
  }

  grasp(event) {
    const point = this.handleOf(event);
    (this.handles.children[point] ?? this.element).focus({ preventScroll: true });
    return { point };
  }

  key(event) {
    const [point, arrow] = [this.handleOf(event), arrowOf(event)];
    if (point === undefined || !arrow) return super.key(event);
    this.nudge(point, arrow);
    return true;
  }
}

const newHandle = () => svg("g", { class: "roi-handle", tabindex: "0", role: "button" }, svg("circle", { class: "roi-grip" }), svg("circle", { class: "roi-dot" }));

export function put(circle, x, y, r) {
  circle.setAttribute("cx", x);
  circle.setAttribute("cy", y);
  circle.setAttribute("r", r);
}

/** As many children as there are, each redrawn; those that stay keep their focus. */
export function keep(group, count, make, draw) {
  while (group.children.length > count) group.lastChild.remove();
  while (group.children.length < count) group.append(make());
  [...group.children].forEach(draw);
}
