// The state of the campaign, kept up to date while the page is visible; every part listens to the data that it shows.

import { all, follow, get, getChanged, patch, pathOf } from "../api.js";
import { askLast } from "../dom.js";
import { counted, natural } from "../format.js";

const [FIRST, REST, TOGETHER] = [200, 2000, 1000];

export const isRead = (frame) => ["read", "extracted"].includes(frame.state);

export class CampaignState extends EventTarget {
  constructor(id, method) {
    super();
    Object.assign(this, { id, method, path: `/v1/campaigns/${id}`, campaign: null, roi: null, unused: {} });
    Object.assign(this, { frames: [], withdrawn: [], gaps: [], byId: new Map(), complete: false, tag: null });
    this.pictures = new Pictures(this.path);
    // another page is shown in this document: what listens has gone
    addEventListener("left", () => (this.left = true), { once: true });
  }

  on(name, listener) {
    this.addEventListener(name, listener);
  }

  tell(name) {
    if (!this.left) this.dispatchEvent(new Event(name));
  }

  /** The first rows are there when this ends; all else about the campaign takes longer to find out. */
  async open() {
    const { body } = await getChanged(`${this.path}/grid?limit=${FIRST}`);
    this.next = body.next;
    this.take([body]);
  }

  /** The campaign itself is known when this ends; the other frames follow. */
  async know() {
    const campaign = await get(this.path);
    Object.assign(this, { campaign, roi: await this.readRoi(campaign) });
    this.complete = !this.next;
    this.tell("frames");
    this.following = follow(() => this.look());
  }

  async touch() {
    await this.following?.();
  }

  async readRoi({ roi_id: id }) {
    if (!id) return null;
    return id === this.roi?.id ? this.roi : get(`${this.path}/roi`);
  }

  /** One request while nothing happens: the tag changes with the campaign. What has changed since is read alone. */
  async look() {
    const isLast = askLast(this);
    const { tag, body } = await getChanged(`${this.path}/grid?limit=${REST}${this.since ? `&since=${this.since}` : ""}`, this.tag);
    if (!body) return;
    const pages = [body];
    for (let next = body.next; next; next = pages.at(-1).next) pages.push(await get(pathOf(next)));
    const campaign = await get(this.path);
    const roi = await this.readRoi(campaign);
    if (!isLast()) return;
    const roiChanged = roi?.id !== this.roi?.id;
    Object.assign(this, { campaign, roi, tag, since: body.since, complete: true });
    this.take(pages);
    this.tell("campaign");
    if (roiChanged) this.tell("roi");
  }

  take(pages) {
    const every = pages.flatMap(({ frames }) => {
      const columns = Object.entries(frames);
      return frames.id.map((_, at) => Object.fromEntries(columns.map(([name, values]) => [name, values[at]])));
    });
    this.gaps = pages[0].gaps;
    const known = new Map(pages[0].partial ? this.byId : []);
    for (const frame of every) known.set(frame.id, frame);
    this.gather(known);
  }

  gather(known) {
    this.byId = known;
    this.frames = [...known.values()].filter((frame) => !frame.withdrawn);
    this.withdrawn = [...known.values()].filter((frame) => frame.withdrawn);
    this.tell("frames");
  }

  /** Change frames alike; what is shown changes at once, and the service's answer takes its place. They are `expected` to be as shown. */
  async change(ids, said, expected) {
    try {
      for (let from = 0; from < ids.length; from += TOGETHER) await patch(`${this.path}/frames`, { frame_ids: ids.slice(from, from + TOGETHER), expected, ...said });
    } catch (error) {
      // another user was faster: it is shown beside what is said of it
      if (error.status === 409) this.touch();
      throw error;
    }
    // what was asked for before does not know of it
    askLast(this);
    const { reason, left_out: out, ...shown } = said;
    for (const id of ids) Object.assign(this.byId.get(id), shown, "scene" in said ? { scene: said.scene || null } : {}, out === undefined ? {} : { left_out: out ? (reason ?? "") : null });
    this.gather(this.byId);
    this.touch();
  }

  readings() {
    return all(`${this.path}/readings`);
  }

  get scenes() {
    return [...new Set(this.frames.map((frame) => frame.scene).filter(Boolean))].sort(natural);
  }
}

const FOUND = { code: "found by the code of", reflect_area: "as the camera stated it for", other_band: "taken from another band, of" };

/** A frame's own region in words; "" where the campaign's holds. */
export function originOf(frame) {
  if (!frame.roi_id) return "";
  if (frame.roi_origin !== "found") return "drawn for this frame";
  return `${FOUND[frame.roi_found_by]} ${frame.panel_serial ? `panel ${frame.panel_serial}` : "the panel"}`;
}

/** What to do about it, on the frame that is shown; "" where the campaign's region holds. */
export function adviceOn(frame, state) {
  if (startsEmpty(frame, state)) return "A field frame starts without a region: the campaign’s lies where the calibration was made. Draw what this frame shows, and set it only for this frame.";
  if (!frame.roi_id) return "";
  const said = frame.roi_origin === "found" ? `This frame’s region is shown, ${originOf(frame)}.` : "This frame’s own region is shown.";
  return `${said} To replace it, draw a region and set it only for this frame. A region set for the campaign does not replace it.`;
}

/** How many frames have a region of their own: {own, found, said}; `said` is "" where none has. */
export function countOwn(frames) {
  const own = frames.filter((frame) => frame.roi_id);
  const found = own.filter((frame) => frame.roi_origin === "found").length;
  const said = [found && `${counted(found, "frame")} found on the panel`, own.length - found && `${counted(own.length - found, "frame")} drawn individually`].filter(Boolean).join(", ");
  return { own: own.length, found, said };
}

/** Whether a frame shows another place than the campaign's region is meant for; a night's region is meant for its frames. */
export const startsEmpty = (frame, state) => !state.method.measures && frame.role === "field" && !frame.roi_id;

const known = new Map();

/** The region that holds for a frame, as the API has it; null where there is none yet. */
export function holdingFor(state, frame) {
  if (!frame.roi_id || frame.roi_id === state.roi?.id) return state.roi;
  if (!known.has(frame.roi_id)) {
    const asked = get(`/v1/frames/${frame.id}/roi`);
    known.set(frame.roi_id, asked);
    asked.catch(() => known.delete(frame.roi_id));
  }
  return known.get(frame.roi_id);
}

const PICTURES_TOGETHER = 32;
const MOST_KEPT = 2000;

const isSeen = (image) => {
  const { top, bottom } = image.getBoundingClientRect();
  return bottom > 0 && top < innerHeight;
};

class Pictures {
  constructor(path) {
    Object.assign(this, { path, kept: new Map(), asking: false });
  }

  /** Ask for the pictures that images lack, some after the others, and first for those that are seen. */
  async show() {
    let lacking = this.put();
    if (this.asking) return;
    this.asking = true;
    try {
      for (; lacking.length; lacking = this.put()) {
        const seen = lacking.filter(isSeen);
        await this.ask((seen.length ? seen : lacking).slice(0, PICTURES_TOGETHER));
      }
    } catch (error) {
      // asked for again when the grid is drawn the next time
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

  async ask(images) {
    const names = new Map(images.map(({ dataset: { frame, name } }) => [frame, name]));
    const { items } = await get(`${this.path}/thumbnails?${[...names.values()].map((name) => `of=${name}`).join("&")}`);
    const found = new Map(items.map(({ frame_id: id, picture }) => [id, picture]));
    // what has no picture although it should is not asked for again
    for (const [id, name] of names) this.keep(id, name, found.get(id));
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
export const imageOf = (frame) => ({ "data-frame": frame.id, "data-name": `${frame.id}.${frame.thumbnail}` });

const bytesOf = (base64) => Uint8Array.from(atob(base64), (each) => each.charCodeAt(0));
