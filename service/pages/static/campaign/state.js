// The state of the campaign, kept up to date while the page is visible; every part listens to the data that it shows.

import { all, get, getChanged, patch, pathOf } from "../api.js";
import { natural } from "../groups.js";
import { Turns, follow } from "../live.js";
import { Pictures } from "./pictures.js";

const FIRST = 200;
const REST = 2000;
/** Frames that one request changes. */
const TOGETHER = 1000;

/** Whether a frame has been read: only then is there a picture of it. */
export const isRead = (frame) => ["read", "extracted"].includes(frame.state);

export class CampaignState extends EventTarget {
  constructor(id, method) {
    super();
    Object.assign(this, { id, method, path: `/v1/campaigns/${id}`, campaign: null, roi: null });
    Object.assign(this, { frames: [], withdrawn: [], gaps: [], byId: new Map(), complete: false, tag: null });
    this.turns = new Turns();
    this.pictures = new Pictures(this.path);
    /** The gravest reason of each frame, as {outcome, reasons}. */
    this.verdicts = new Map();
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
    this.following = follow(() => this.look(), { events: { address: `${this.path}/events`, kind: "campaign" } });
  }

  /** Look at once: something was changed here. */
  async touch() {
    await this.following?.now();
  }

  async readRoi({ roi_id: id }) {
    if (!id) return null;
    return id === this.roi?.id ? this.roi : get(`${this.path}/roi`);
  }

  /** One request while nothing happens: the tag changes with the campaign. What has changed since is read alone. */
  async look() {
    const turn = this.turns.ask();
    const { tag, body } = await getChanged(`${this.path}/grid?limit=${REST}${this.since ? `&since=${this.since}` : ""}`, this.tag);
    if (!body) return;
    const pages = [body];
    for (let next = body.next; next; next = pages.at(-1).next) pages.push(await get(pathOf(next)));
    const campaign = await get(this.path);
    const roi = await this.readRoi(campaign);
    if (!this.turns.take(turn)) return;
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
    this.gather([...known.values()]);
  }

  gather(every) {
    this.frames = every.filter((frame) => !frame.withdrawn);
    this.withdrawn = every.filter((frame) => frame.withdrawn);
    this.byId = new Map(every.map((frame) => [frame.id, frame]));
    this.verdicts = new Map(this.frames.map((frame) => [frame.id, { outcome: frame.outcome, reasons: frame.code ? [frame] : [] }]));
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
    this.turns.take();
    const { reason, left_out: out, ...shown } = said;
    for (const id of ids) Object.assign(this.byId.get(id), shown, "scene" in said ? { scene: said.scene || null } : {}, out === undefined ? {} : { left_out: out ? (reason ?? "") : null });
    this.gather([...this.byId.values()]);
    this.touch();
  }

  readings() {
    return all(`${this.path}/readings`);
  }

  get scenes() {
    return [...new Set(this.frames.map((frame) => frame.scene).filter(Boolean))].sort(natural);
  }
}
