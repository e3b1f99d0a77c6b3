// The files that the page was given: hashed, compared with what the service has, and sent meanwhile.

import { post, send } from "../api.js";
import { Journal } from "./journal.js";
import { WHOLE_BYTES, sendFile } from "./sender.js";

const AT_ONCE = 2;
/** Small files, on a line that carries each within a second. A browser has six connections: events take one, and the page asks meanwhile. */
const MOST_AT_ONCE = 4;
const QUICK_MS = 1000;
const LONGEST_PAUSE_MS = 30000;
const STALLED_MS = 30000;
/** Longer than what a slow line holds under way needs. */
const SILENT_MS = 120000;
/** A service that is not there cannot be overrun; once it is back, it is found soon. */
const LONGEST_OFFLINE_MS = 2000;
const ASK_AT_MOST = 1000;
const ASK_TOGETHER = 50;
export const OPEN = ["hashing", "asking", "waiting", "sending", "retrying"];

/**
 * Items: {key, name, size, file, role, scene, sha256, state, armed, sent, frameId, error}. States: hashing, asking,
 * ready, there (the service has it), waiting, sending, retrying, sent, failed, lost (its file must be chosen again).
 * An armed item goes on by itself once it has been compared. `refusal`: {code, detail, item, left, sent} stopped the rest.
 */
export class UploadQueue extends EventTarget {
  constructor(state) {
    super();
    this.path = state.path;
    this.items = [];
    this.journal = new Journal(state.id);
    this.moved = [];
    this.refusal = null;
    this.width = AT_ONCE; // so many small files at once
    this.accepted = new Set(); // codes of refusals despite which the rest is sent
    addEventListener("online", () => this.retryNow());
    // a phone that has slept does not know which of its connections still lead anywhere
    document.addEventListener("visibilitychange", () => document.hidden || this.retryNow());
    // one that has died without a word ends at no time of itself
    setInterval(() => this.giveUp(SILENT_MS) && this.pump(), STALLED_MS / 3);
  }

  /** Files with their paths: [{file, name, role?, scene?}]; `judge(name)` says what each is. Answers how many were new. */
  add(files, judge) {
    const before = this.items.length;
    for (const { file, name, ...said } of files) {
      const key = `${name} ${file.size} ${file.lastModified}`;
      const known = this.items.find((item) => item.key === key) ?? this.lost(file, name);
      if (known) {
        if (known.state === "lost") this.find(known, file);
        continue;
      }
      const item = { key, name, file, size: file.size, modified: file.lastModified, state: "hashing", sent: 0, ...(said.role ? { ...said, edited: true } : judge(name)) };
      this.items.push(item);
      this.hash(item);
    }
    this.changed();
    return this.items.length - before;
  }

  /** Go on with what an earlier visit did not finish. Answers how many files that are. */
  async resume() {
    await hold(`stilb-upload ${this.path}`);
    const rows = (await this.journal.read()).filter((row) => !this.items.some((item) => item.key === row.key));
    for (const row of rows) {
      const item = { ...row, sent: 0, state: "lost", armed: true };
      this.items.push(item);
      if (row.file && (await readable(row.file))) Object.assign(item, { state: row.sha256 ? "asking" : "hashing" });
      else delete item.file;
      if (item.state === "hashing") this.hash(item);
    }
    if (rows.length) await this.ask(this.items.filter((item) => item.state === "asking"));
    return rows.length;
  }

  /** Send everything that is listed: what has been compared at once, the rest as soon as it has been. */
  async send({ again = true } = {}) {
    this.refusal = null;
    const open = this.items.filter((item) => !item.armed && ["hashing", "asking", "ready", again && "failed"].includes(item.state));
    for (const item of open) {
      if (item.state === "failed" && !item.sha256) this.hash(Object.assign(item, { state: "hashing" }));
      Object.assign(item, { armed: true, error: undefined, state: ["ready", "failed"].includes(item.state) ? "waiting" : item.state });
    }
    // begun before all is written down: the first bytes need not wait for the journal
    this.pump();
    await this.journal.add(open.filter((item) => item.armed));
    // what was stopped or sent meanwhile is not to be sent after a reload
    await this.journal.clear(open.filter((item) => !item.armed || ["sent", "there"].includes(item.state)).map((item) => item.key));
  }

  /** Send no more; what has not been sent stays listed. */
  async stop() {
    const held = this.items.filter((item) => item.armed && OPEN.includes(item.state));
    for (const item of held) {
      item.abort?.abort();
      clearTimeout(item.timer);
      Object.assign(item, { armed: false, sent: 0, state: ["hashing", "asking"].includes(item.state) ? item.state : "ready" });
    }
    this.changed();
    await this.journal.clear(held.map((item) => item.key));
  }

  /** The first refusal of its kind stops the rest: what one file suffers may await all of them. */
  refuse(item, { code, message }) {
    if (this.accepted.has(code) || this.refusal) return;
    const left = this.items.filter((each) => each !== item && each.armed && OPEN.includes(each.state)).length;
    if (!left) return;
    this.refusal = { code, detail: message, item, left, sent: this.items.filter((each) => each.state === "sent").length };
    this.stop();
  }

  /** Send the rest in spite of a refusal; others of its kind then stop nothing. */
  goOn() {
    this.accepted.add(this.refusal.code);
    return this.send({ again: false });
  }

  retryNow() {
    this.giveUp(STALLED_MS);
    for (const item of this.items) this.again(item);
    this.pump();
  }

  /** Send anew what has not moved for so long. Answers how many files that are. */
  giveUp(afterMs) {
    const still = this.items.filter((item) => item.state === "sending" && Date.now() - item.movedAt > afterMs);
    for (const item of still) {
      item.abort.abort();
      item.state = "waiting";
    }
    return still.length;
  }

  /** Leave out what has not been sent. */
  async drop(items) {
    for (const item of items) {
      item.abort?.abort();
      if (item.upload && item.state !== "sent") send("DELETE", item.upload).catch(() => {});
    }
    this.items = this.items.filter((item) => !items.includes(item));
    await this.journal.clear(items.map((item) => item.key));
    this.changed();
  }

  pump() {
    const sending = this.items.filter((item) => item.state === "sending");
    for (const next of this.items) {
      if (next.state !== "waiting") continue;
      const small = [...sending, next].every((item) => item.size < WHOLE_BYTES);
      if (sending.length >= (small ? this.width : AT_ONCE)) break;
      sending.push(next);
      this.sendOne(next);
    }
    this.changed();
  }

  async sendOne(item) {
    const begunAt = Date.now();
    Object.assign(item, { state: "sending", movedAt: begunAt });
    item.abort = new AbortController();
    try {
      const frame = await sendFile(this.path, item, { signal: item.abort.signal, onProgress: (bytes) => this.progress(item, bytes), onBegun: () => this.journal.note(item) });
      this.progress(item, item.size);
      Object.assign(item, { state: "sent", frameId: frame.id, attempts: 0 });
      this.lostSince = undefined;
      // of a line that breaks, what it carries in a second may be lost
      this.width = Date.now() - begunAt < QUICK_MS ? Math.min(this.width + 1, MOST_AT_ONCE) : AT_ONCE;
      await this.journal.remove(item.key);
      this.dispatchEvent(new Event("sent"));
    } catch (error) {
      if (error.name === "AbortError") return;
      this.failed(item, error);
    }
    this.pump();
  }

  failed(item, error) {
    if (!item.upload) item.sent = 0;
    item.error = error.message;
    if (!error.retryable) {
      Object.assign(item, { state: "failed", armed: false });
      this.refuse(item, error);
      return;
    }
    item.state = "retrying";
    this.width = AT_ONCE;
    if (error.code === "offline") this.lostSince ??= Date.now();
    item.attempts = (item.attempts ?? 0) + 1;
    const pause = Math.min(1000 * 2 ** (item.attempts - 1), error.code === "offline" ? LONGEST_OFFLINE_MS : LONGEST_PAUSE_MS);
    item.timer = setTimeout(() => (this.again(item), this.pump()), pause);
  }

  again(item) {
    clearTimeout(item.timer);
    if (item.state === "retrying") item.state = "waiting";
  }

  progress(item, bytes) {
    this.moved.push([Date.now(), bytes - item.sent]);
    Object.assign(item, { sent: bytes, movedAt: Date.now() });
    this.changed();
  }

  /** Bytes a second over the last ten. */
  get rate() {
    const since = Date.now() - 10000;
    this.moved = this.moved.filter(([at]) => at > since);
    const from = this.moved[0]?.[0];
    return from ? this.moved.reduce((sum, [, count]) => sum + count, 0) / Math.max(1, (Date.now() - from) / 1000) : 0;
  }

  hash(item) {
    this.hashers ??= startHasher((id, found) => this.hashed(id, found));
    this.hashers.postMessage({ id: item.key, file: item.file });
  }

  hashed(key, { sha256, error }) {
    const item = this.items.find((each) => each.key === key);
    if (!item) return;
    Object.assign(item, error ? { state: "failed", error } : { state: "asking", sha256 });
    const asking = this.items.filter((each) => each.state === "asking" && !each.asked);
    const last = !this.items.some((each) => each.state === "hashing");
    // together, unless the line is idle and could carry the first of them
    const idle = item.armed && !this.items.some((each) => ["waiting", "sending"].includes(each.state));
    if (asking.length && (last || idle || asking.length >= ASK_TOGETHER)) this.ask(asking);
    this.changed();
  }

  /** Which of them the service has already; the others are sent, or ready for it. */
  async ask(items) {
    for (const item of items) item.asked = true;
    for (let at = 0; at < items.length; at += ASK_AT_MOST) {
      const some = items.slice(at, at + ASK_AT_MOST);
      let known = new Map();
      try {
        const answer = await post(`${this.path}/frames/known`, { sha256: some.map((item) => item.sha256) }, { signal: AbortSignal.timeout(STALLED_MS) });
        known = new Map(answer.known.map((each) => [each.sha256, each]));
      } catch (error) {
        // without an answer they are sent, and the service finds out
        if (!error.code) throw error;
      }
      for (const item of some) {
        const there = known.get(item.sha256);
        if (there && there.state !== "refused") {
          Object.assign(item, { state: "there", frameId: there.frame_id, sent: item.size });
          await this.journal.remove(item.key);
        } else item.state = item.armed ? "waiting" : "ready";
        item.asked = false;
      }
    }
    this.pump();
  }

  lost(file, name) {
    const own = name.split("/").at(-1);
    return this.items.find((item) => item.state === "lost" && item.size === file.size && item.modified === file.lastModified && item.name.split("/").at(-1) === own);
  }

  find(item, file) {
    Object.assign(item, { file, state: item.sha256 ? "waiting" : "hashing", armed: true });
    if (item.sha256) this.pump();
    else this.hash(item);
  }

  changed() {
    this.dispatchEvent(new Event("changed"));
  }
}

async function readable(file) {
  try {
    await file.slice(0, 1).arrayBuffer();
    return true;
  } catch {
    return false;
  }
}

/** Until this page is the one that sends what was left: of two tabs on a campaign, the second waits for the first. */
function hold(name) {
  if (!navigator.locks) return Promise.resolve();
  return new Promise((done) => {
    navigator.locks.request(name, () => {
      done();
      return new Promise(() => {});
    });
  });
}

function startHasher(take) {
  const worker = new Worker(new URL("./hash-worker.js", import.meta.url), { type: "module" });
  worker.onmessage = ({ data: { id, ...found } }) => take(id, found);
  return worker;
}
