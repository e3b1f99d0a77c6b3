// The large picture of a frame: its preview, and where it is near enough the frame's very pixels, drawn by the service.

import { post } from "../api.js";
import { h, svg } from "../dom.js";
import { counted, number } from "../format.js";
import { followJob, pause } from "../live.js";
import { PictureView } from "./picture-view.js";

const SETTLE_MS = 250;
const MOST_SIDE_PX = 1024;
const SNAP_PX = 64;
/** Frame pixels per pixel of the screen from which pixels can be told apart. */
const NEAR = 1.26;

/** `tell` hears of each new place; `rangeOf` gives the raw values from black to white that another picture shows, or null. */
export class LargePicture extends PictureView {
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
    this.caption.textContent = "Reading the pixels…";
    try {
      await pause(SETTLE_MS);
      const range = await this.rangeOf(frame);
      if (signal.aborted) return null;
      const job = await followed(await post(`/v1/frames/${frame.id}/crops`, { ...window, ...range }, { signal }), signal);
      if (signal.aborted) return null;
      if (!job.result) throw Object.assign(new Error(job.error.detail), { name: "Refused" });
      const { picture, low_dn: low, high_dn: high, clipped_px: clipped, row0_px: y, col0_px: x, height_px: height, width_px: width } = job.result;
      for (const [name, value] of Object.entries({ href: picture, x, y, width, height })) this.crop.setAttribute(name, value);
      const dn = (value) => number(Math.round(value), 6);
      this.caption.textContent = `Pixels of the sensor, as recorded: column ${x} to ${x + width - 1}, row ${y} to ${y + height - 1}; black is ${dn(low)} DN, white ${dn(high)} DN; ${clipped ? `${counted(clipped, "pixel")} clipped, in red` : "none is clipped"}.`;
      return { low_dn: low, high_dn: high };
    } catch (error) {
      if (error.name === "AbortError" || signal.aborted) return null;
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

const followed = (job, signal) => (job.state === "succeeded" ? job : followJob(job.id, () => {}, { signal }));
