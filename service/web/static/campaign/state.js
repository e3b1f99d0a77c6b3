// The state of the campaign, kept up to date while the page is visible; every part listens to the data that it shows.

import { all, get } from "../api.js";
import { follow } from "../live.js";

const FIRST = 100;
const REST = 250;
const LOOK_WHOLE_EVERY = 5;

const ENDED = ["extracted", "refused"];

/** Whether a frame has been read: only then is there a picture of it. */
export const isRead = (frame) => ["read", "extracted"].includes(frame.state);

export class CampaignState extends EventTarget {
  constructor(id, method) {
    super();
    Object.assign(this, { id, method, path: `/v1/campaigns/${id}`, campaign: null, roi: null });
    this.frames = [];
    this.byId = new Map();
    this.verdicts = new Map();
    this.complete = false;
    this.pages = [];
    this.turn = 0;
  }

  on(name, listener) {
    this.addEventListener(name, listener);
  }

  tell(name) {
    this.dispatchEvent(new Event(name));
  }

  /** The first rows are there when this ends; all else about the campaign takes longer to find out. */
  async open() {
    await this.readPage(`${this.path}/frames?brief=true&limit=${FIRST}`, 0);
    this.gather();
  }

  /** The campaign itself is known when this ends; the other rows and the verdicts follow. */
  async know() {
    const campaign = await get(this.path);
    Object.assign(this, { campaign, roi: await this.readRoi(campaign) });
    this.tell("frames");
    this.following = follow(() => this.look());
  }

  /** Look at once: something was changed here. */
  async touch() {
    this.turn = 0;
    await this.following?.now();
  }

  async readRoi({ roi_id: id }) {
    if (!id) return null;
    return id === this.roi?.id ? this.roi : get(`${this.path}/roi`);
  }

  async look() {
    let changed = false;
    for (let index = 0; index < this.pages.length; index += 1) {
      const page = this.pages[index];
      if (page.next === null || page.items.some((frame) => !ENDED.includes(frame.state)) || this.turn === 0) {
        changed = (await this.readPage(page.address, index)) || changed;
      }
      if (page.next && !this.pages[index + 1]) {
        changed = (await this.readPage(page.next, index + 1)) || changed;
        this.gather();
      }
    }
    this.complete = true;
    if (changed) this.gather();
    // others may have set a region or added readings, which shows in the campaign alone
    const campaign = await get(this.path);
    const other = JSON.stringify(campaign) !== JSON.stringify(this.campaign);
    if (changed || other || this.turn % LOOK_WHOLE_EVERY === 0) await this.lookAround(campaign);
    this.turn += 1;
  }

  async lookAround(campaign) {
    const verdicts = await get(`${this.path}/verdicts`);
    const roi = await this.readRoi(campaign);
    const roiChanged = roi?.id !== this.roi?.id;
    Object.assign(this, { campaign, roi });
    this.verdicts = new Map(verdicts.items.map((each) => [each.frame_id, each]));
    this.tell("campaign");
    this.tell("frames");
    if (roiChanged) this.tell("roi");
  }

  /** Whether anything in the page is new. */
  async readPage(address, index) {
    const { items, next } = await get(address);
    const page = { address, items, next: next && nextAddress(next), text: JSON.stringify(items.map(outline)) };
    const changed = this.pages[index]?.text !== page.text || this.pages[index]?.next !== page.next;
    this.pages[index] = page;
    return changed;
  }

  gather() {
    this.frames = this.pages.flatMap((page) => page.items);
    this.byId = new Map(this.frames.map((frame) => [frame.id, frame]));
    this.tell("frames");
  }

  /** Put an answer of the API in the place of what is shown of a frame. */
  renew(frame) {
    for (const page of this.pages) {
      const at = page.items.findIndex((each) => each.id === frame.id);
      if (at >= 0) page.items[at] = frame;
    }
    this.gather();
  }

  /** The statistics of the region that holds for a frame now, by channel. */
  statisticsOf(frame) {
    const rows = frame.statistics ?? [];
    const wanted = frame.roi_id ?? this.roi?.id ?? rows.at(-1)?.roi;
    return rows.filter((row) => row.roi === wanted);
  }

  readings() {
    return all(`${this.path}/readings`);
  }

  get scenes() {
    return [...new Set(this.frames.map((frame) => frame.scene).filter(Boolean))].sort(new Intl.Collator(undefined, { numeric: true }).compare);
  }
}

const outline = (frame) => [frame.id, frame.state, frame.role, frame.scene, frame.roi_id, frame.statistics.length, frame.exposure_time_s, frame.iso];

// the first page is small, so that it is there at once; the others need not be
function nextAddress(next) {
  const { pathname, searchParams } = new URL(next);
  searchParams.set("limit", REST);
  return `${pathname}?${searchParams}`;
}
