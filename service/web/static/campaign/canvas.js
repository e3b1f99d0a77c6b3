// The preview with its regions: zoom by wheel, pinch and keys; corners moved by pointer and keys.

import { svg } from "../dom.js";
import { middle } from "./polygon.js";

const NEAR_PX = 10;
const CLOSEST = 1 / 40;

export class RegionCanvas {
  constructor(editor) {
    this.editor = editor;
    this.picture = svg("image", { preserveAspectRatio: "none" });
    this.shade = svg("path", { class: "roi-shade" });
    this.clipped = svg("g", { class: "roi-clipped" });
    this.cells = svg("path", { class: "roi-cells" });
    this.shapes = svg("g");
    this.mids = svg("g");
    this.handles = svg("g");
    this.element = svg(
      "svg",
      { class: "roi-canvas", tabindex: "0", role: "application", "aria-label": "Region on the preview. Arrows pan, plus and minus zoom, 0 shows all; Tab goes to the corners, arrows move a corner, Insert adds one after it, Delete removes it." },
      this.picture, this.clipped, this.shade, this.cells, this.shapes, this.mids, this.handles,
    );
    this.pointers = new Map();
    this.size = [3, 2];
    this.box = [0, 0, 3, 2];
    editor.addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.draw()).observe(this.element);
    this.listen();
  }

  show({ url, width, height }) {
    const same = this.size[0] === width && this.size[1] === height;
    this.size = [width, height];
    this.editor.size = [width, height];
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

  /** Lines over the picture, each from one point to another. */
  showCells(lines) {
    this.cells.setAttribute("d", lines.map(([from, to]) => `M${from}L${to}`).join(""));
  }

  fit() {
    this.look([0, 0, ...this.size]);
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

  listen() {
    const { element } = this;
    element.addEventListener("pointerdown", (event) => this.down(event));
    element.addEventListener("pointermove", (event) => this.moved(event));
    for (const name of ["pointerup", "pointercancel"]) element.addEventListener(name, (event) => this.up(event));
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(Math.min(Math.max(event.deltaY, -120), 120) / 300), this.at(event));
    }, { passive: false });
    element.addEventListener("keydown", (event) => this.key(event));
  }

  down(event) {
    if (event.button > 0) return;
    this.element.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, event);
    if (this.pointers.size > 1) {
      this.drag = { pinch: true };
      return;
    }
    const handle = event.target.closest("[data-point]");
    const { mid, region } = event.target.dataset;
    this.drag = { from: event, region: region === undefined ? undefined : Number(region) };
    if (handle) Object.assign(this.drag, { point: Number(handle.dataset.point) });
    else if (mid !== undefined) {
      this.editor.insert(Number(mid), this.at(event));
      Object.assign(this.drag, { point: Number(mid), remembered: true, moved: true });
    }
    if (handle) handle.focus();
    else this.element.focus({ preventScroll: true });
  }

  moved(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before || !this.drag) return;
    if (this.drag.pinch) {
      this.pinch(event);
    } else if (this.drag.moved || Math.hypot(event.clientX - this.drag.from.clientX, event.clientY - this.drag.from.clientY) > 4) {
      if (this.drag.point !== undefined) {
        if (!this.drag.remembered) this.editor.remember();
        this.drag.remembered = true;
        this.editor.move(this.drag.point, this.at(event));
      } else this.pan((before.clientX - event.clientX) * this.scale, (before.clientY - event.clientY) * this.scale);
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
    if (!this.pointers.delete(event.pointerId) || !this.drag) return;
    const { pinch, moved, point, region } = this.drag;
    if (this.pointers.size) return;
    this.drag = null;
    if (pinch) return;
    if (moved && point !== undefined) this.editor.tell(true);
    else if (!moved && event.type === "pointerup") this.tap(event, point, region);
  }

  tap(event, point, region) {
    const { editor } = this;
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
    else if (arrow) this.pan(arrow[0] * this.box[2] * 0.1, arrow[1] * this.box[3] * 0.1);
    else if (["+", "="].includes(event.key)) this.zoom(0.8);
    else if (event.key === "-") this.zoom(1.25);
    else if (event.key === "0") this.fit();
    else if (["Delete", "Backspace"].includes(event.key) && index !== null) {
      editor.remove(index);
      (this.handles.children[Math.min(index, editor.points.length - 1)] ?? this.element).focus();
    } else if (["Insert", "a"].includes(event.key) && index !== null) {
      editor.insert(index + 1, middle(editor.points[index], editor.points[(index + 1) % editor.points.length]));
      this.handles.children[index + 1].focus();
    } else if (event.key === "Enter") editor.close();
    else if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") event.shiftKey ? editor.redo() : editor.undo();
    else if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "y") editor.redo();
    else return;
    event.preventDefault();
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
