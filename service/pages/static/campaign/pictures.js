// Small pictures of frames: those in view are asked for together, with their neighbours, and kept while they are right.

import { get } from "../api.js";

/** Pictures of one request: a run of the grid's order, so that the same place is asked for in the same words, and found in the browser's cache. */
const TOGETHER = 32;
const MOST_KEPT = 2000;

const isSeen = (image) => {
  const { top, bottom } = image.getBoundingClientRect();
  return bottom > 0 && top < innerHeight;
};
const nameOf = (frame) => `${frame.id}.${frame.thumbnail}`;

export class Pictures {
  constructor(path) {
    Object.assign(this, { path, order: [], places: new Map(), kept: new Map(), asking: false });
  }

  /** The order of the grid, from which neighbours are taken. */
  arrange(order) {
    this.order = order;
    this.places = new Map(order.map((frame, at) => [frame.id, at]));
  }

  /** Ask for the pictures that images lack, one run after the other: the first is there soonest on a slow line. */
  async show() {
    if (this.asking) return;
    this.asking = true;
    try {
      for (let lacking = this.put(); lacking.length; lacking = this.put()) await this.ask(this.runOf(lacking.find(isSeen) ?? lacking[0]));
    } catch (error) {
      // asked for again when the grid comes to rest the next time
      if (!error.code) throw error;
    } finally {
      this.asking = false;
    }
  }

  /** Give the images of the page the pictures that are there; answers those that lack theirs. */
  put() {
    return [...document.querySelectorAll("img[data-frame]")].filter((image) => {
      const kept = this.kept.get(image.dataset.frame);
      if (kept?.name !== image.dataset.name) return true;
      if (kept.url && image.src !== kept.url) image.src = kept.url;
      return false;
    });
  }

  /** The frame of an image with its neighbours, as far as they lack their pictures; alone where the grid does not show it. */
  runOf({ dataset: { frame: id, name } }) {
    const first = Math.floor(this.places.get(id) / TOGETHER) * TOGETHER;
    const run = this.order.slice(first, first + TOGETHER).filter((frame) => frame.thumbnail && this.kept.get(frame.id)?.name !== nameOf(frame));
    return run.some((frame) => nameOf(frame) === name) ? run : [{ id, thumbnail: name.slice(id.length + 1) }];
  }

  async ask(run) {
    const { items } = await get(`${this.path}/thumbnails?${run.map((frame) => `of=${nameOf(frame)}`).join("&")}`);
    const found = new Map(items.map(({ frame_id: id, picture }) => [id, picture]));
    // what has no picture although it should is not asked for again
    for (const frame of run) this.keep(frame.id, nameOf(frame), found.get(frame.id));
  }

  keep(id, name, picture) {
    this.drop(id);
    this.kept.set(id, { name, url: picture && URL.createObjectURL(new Blob([bytesOf(picture)], { type: "image/webp" })) });
    if (this.kept.size > MOST_KEPT) this.drop(this.kept.keys().next().value);
  }

  drop(id) {
    const { url } = this.kept.get(id) ?? {};
    if (url) URL.revokeObjectURL(url);
    this.kept.delete(id);
  }
}

/** An image whose picture is to come; it has none while the frame was not read. */
export const imageOf = (frame) => ({ "data-frame": frame.id, "data-name": nameOf(frame) });

const bytesOf = (base64) => Uint8Array.from(atob(base64), (each) => each.charCodeAt(0));
