// What is seen of one frame: all of it or its pixels, alone or beside another frame at the same place.

import { pause, runJob } from "../api.js";
import { h, svg } from "../dom.js";
import { counted, exposureTime, number } from "../format.js";
import { select } from "../ask.js";
import { PictureView } from "./picture-view.js";
import { holdingFor, isRead } from "./state.js";

const SETTLE_MS = 250;
const MOST_SIDE_PX = 1024;
const SNAP_PX = 64;
/** Frame pixels per pixel of the screen from which pixels can be told apart. */
const NEAR = 1.26;

/** `tell` hears of each new place; `rangeOf` gives the raw values from black to white that another picture shows, or null. */
class LargePicture extends PictureView {
  constructor({ label, tell = () => {}, rangeOf = async () => null }) {
    const [crop, lines] = [svg("image", { class: "crop", preserveAspectRatio: "none" }), svg("g")];
    super({ class: "large", "aria-label": label }, crop, lines);
    // the regions lie over the pixels
    Object.assign(this, { crop, lines, tell, rangeOf, frame: null, range: Promise.resolve(null) });
    this.caption = h("p", { class: "muted small", role: "status" });
    this.asked = new AbortController();
  }

  show(frame, outlines) {
    if (this.frame?.id !== frame.id) {
      this.forget();
      this.frame = frame;
      for (const [name, text] of Object.entries({ role: "img", "aria-label": `Preview of ${frame.filename}` })) this.picture.setAttribute(name, text);
      super.show({ url: `/v1/frames/${frame.id}/preview.png`, width: frame.width_px, height: frame.height_px });
    }
    const draw = (kind) => outlines.map((points) => svg("polygon", { class: kind, points: points.map((point) => point.join(",")).join(" ") }));
    this.lines.replaceChildren(...draw("under"), ...draw("outline"));
  }

  forget() {
    this.asked.abort();
    this.shown = "";
    this.crop.removeAttribute("href");
    this.caption.textContent = "";
  }

  /** One pixel of the frame on each pixel of the screen, at the middle of `points` if there are any. */
  showPixels(points) {
    const { width, height } = this.element.getBoundingClientRect();
    const middle = points?.length ? [0, 1].map((axis) => (Math.min(...points.map((point) => point[axis])) + Math.max(...points.map((point) => point[axis]))) / 2) : this.centre();
    this.look([middle[0] - width / 2, middle[1] - height / 2, width, height]);
  }

  get showsPixels() {
    return this.scale <= NEAR;
  }

  draw() {
    this.tell(this);
    if (!this.frame) return;
    const window = this.showsPixels ? this.windowOf() : null;
    const wanted = window ? `${this.frame.id} ${Object.values(window)}` : "";
    if (wanted === this.shown) return;
    this.forget();
    this.shown = wanted;
    if (window) this.range = this.load(this.frame, window);
  }

  /** What is seen, on a raster: a small move asks for nothing new. */
  windowOf() {
    const [width, height] = this.size;
    const along = (start, length, size) => {
      const from = Math.max(0, Math.floor(start / SNAP_PX) * SNAP_PX);
      const to = Math.min(size, Math.ceil((start + length) / SNAP_PX) * SNAP_PX);
      return [Math.round(from + Math.max(0, to - from - MOST_SIDE_PX) / 2), Math.min(to - from, MOST_SIDE_PX)];
    };
    const [[col0, across], [row0, down]] = [along(this.box[0], this.box[2], width), along(this.box[1], this.box[3], height)];
    return { row0_px: row0, col0_px: col0, height_px: down, width_px: across };
  }

  /** Draw the pixels of a window; the raw values that are shown black and white, or null where it came to nothing. */
  async load(frame, window) {
    this.asked = new AbortController();
    const { signal } = this.asked;
    try {
      await pause(SETTLE_MS);
      const range = await this.rangeOf(frame);
      if (signal.aborted) return null;
      const found = await runJob(`/v1/frames/${frame.id}/crops`, { ...window, ...range }, this.caption, "Reading the pixels", { signal });
      const { picture, low_dn: low, high_dn: high, clipped_px: clipped, row0_px: y, col0_px: x, height_px: height, width_px: width } = found;
      for (const [name, value] of Object.entries({ href: picture, x, y, width, height })) this.crop.setAttribute(name, value);
      const dn = (value) => number(Math.round(value), 6);
      this.caption.textContent = `Pixels of the sensor, as recorded: column ${x} to ${x + width - 1}, row ${y} to ${y + height - 1}; black is ${dn(low)} DN, white ${dn(high)} DN; ${clipped ? `${counted(clipped, "pixel")} clipped, in red` : "none is clipped"}.`;
      return { low_dn: low, high_dn: high };
    } catch (error) {
      if (signal.aborted) return null;
      this.shown = "";
      this.caption.textContent = `The pixels cannot be shown. ${error.message}`;
      return null;
    }
  }

  /** The arrows walk from frame to frame while there is nothing to move. */
  key(event) {
    return event.key.startsWith("Arrow") && this.isWhole ? false : super.key(event);
  }
}

const MOST_LISTED = 200;
/** Exposures that differ by less than camera and file state. */
const SAME_EXPOSURE = 0.01;

/** {element, picture, show(frame, roi)}; the place stays from frame to frame. */
export function viewerPart(state) {
  let frame = null;
  let points = null;
  /** Two frames of one size are compared at one place. */
  const align = (view, another) => {
    if (comparing() && view.size.join() === another.size.join() && view.box.join() !== another.box.join()) another.look(view.box);
  };
  const other = new LargePicture({ label: `Frame to compare with. ${KEYS}`, tell: (view) => align(view, picture), rangeOf: async (shown) => (isAlike(shown, frame) ? picture.range : null) });
  const picture = new LargePicture({ label: `Frame. ${KEYS}`, tell: (view) => (told(), align(view, other)) });

  const press = (text, onclick) => h("button", { type: "button", "aria-pressed": "false", onclick }, text);
  const whole = press("Fit", () => picture.fit());
  const pixels = press("100 %", () => picture.showPixels(points));
  const beside = press("Compare", () => compare(comparing() ? null : candidates()[0]));
  const chosen = select([], { "aria-label": "Frame to compare with", title: "Shown at the same place and zoom", onchange: () => compare(state.byId.get(chosen.value)) });
  /** From the first press on one lies over the other, and each press shows the other one. */
  const turn = () => {
    pair.classList.add("stacked");
    pair.classList.toggle("second");
  };
  const blink = h("button", { type: "button", onclick: turn }, "Blink");
  const named = [h("figcaption", { class: "small" }), h("figcaption", { class: "small" })];
  const figures = [h("figure", {}, picture.element, named[0], picture.caption), h("figure", {}, other.element, named[1], other.caption)];
  const pair = h("div", { class: "pair" }, figures);
  const way = h("span", { class: "actions" }, chosen, h("span", { class: "segments" }, blink));
  const element = h("div", {}, pair, h("div", { class: "under-picture" }, h("div", { class: "segments", role: "group", "aria-label": "View" }, whole, pixels, beside), way));

  const comparing = () => !figures[1].hidden;
  const candidates = () => state.frames.filter((each) => each.id !== frame?.id && isRead(each) && each.width_px === frame?.width_px && each.height_px === frame?.height_px).sort((a, b) => (b.scene === frame.scene) - (a.scene === frame.scene)).slice(0, MOST_LISTED);

  function told() {
    whole.setAttribute("aria-pressed", String(picture.isWhole));
    pixels.setAttribute("aria-pressed", String(!picture.isWhole && Math.abs(picture.scale - 1) < 0.02));
  }

  async function compare(against) {
    figures[1].hidden = way.hidden = !against;
    beside.setAttribute("aria-pressed", String(Boolean(against)));
    named[0].textContent = against ? describe(frame) : "";
    pair.classList.remove("stacked", "second");
    if (!against) return;
    const listed = candidates();
    chosen.replaceChildren(...listed.map((each) => h("option", { value: each.id, selected: each.id === against.id }, [each.filename, each.scene].filter(Boolean).join(" · "))));
    named[1].textContent = describe(against);
    other.show(against, outlinesOf(await holdingFor(state, against)));
    other.look(picture.box);
  }

  compare(null);
  return {
    element,
    picture,
    show(next, roi) {
      const walked = next.id !== frame?.id;
      frame = next;
      const outlines = outlinesOf(roi);
      points = outlines.flat();
      picture.show(frame, outlines);
      beside.disabled = candidates().length === 0;
      const against = comparing() ? (chosen.value === frame.id ? candidates()[0] : state.byId.get(chosen.value)) : null;
      if (walked && comparing()) compare(candidates().includes(against) ? against : candidates()[0]);
    },
  };
}

const KEYS = "Arrows move the picture, plus and minus zoom, 0 shows all.";
const outlinesOf = (roi) => (roi ? (roi.regions?.map((each) => each.polygon) ?? [roi.polygon]) : []);
const exposureOf = ({ exposure_time_s: t, iso, f_number: f }) => (t * iso) / f ** 2;
const isAlike = (a, b) => Math.abs(exposureOf(a) / exposureOf(b) - 1) < SAME_EXPOSURE;
const describe = ({ filename, scene, exposure_time_s: t, f_number: f, iso }) => [filename, scene, t && exposureTime(t), f && `f/${f}`, iso && `ISO ${iso}`].filter(Boolean).join(" · ");
