// The regions in the editor, with their undo history.

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
