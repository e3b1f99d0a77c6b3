// The files that somebody gave the page: hashed, compared with what the service has, sent two at a time.

import { post } from "../api.js";
import { Journal } from "./journal.js";
import { sendFile } from "./sender.js";

const AT_ONCE = 2;
const LONGEST_PAUSE_MS = 30000;
const ASK_AT_MOST = 1000;

/**
 * Items: {key, name, size, file, role, scene, sha256, state, sent, frameId, error}. States: hashing, asking, ready,
 * there (the service has it), waiting, sending, retrying, sent, failed, lost (its file must be chosen again).
 */
export class UploadQueue extends EventTarget {
  constructor(state) {
    super();
    this.path = state.path;
    this.items = [];
    this.journal = new Journal(state.id);
    this.sending = false;
    this.moved = [];
    addEventListener("online", () => this.retryNow());
  }

  /** Files with their paths: [{file, name}]; `judge(name)` says what each is. Answers how many were new. */
  add(files, judge) {
    const before = this.items.length;
    for (const { file, name } of files) {
      const key = `${name} ${file.size} ${file.lastModified}`;
      const known = this.items.find((item) => item.key === key) ?? this.lost(file, name);
      if (known) {
        if (known.state === "lost") this.find(known, file);
        continue;
      }
      const item = { key, name, file, size: file.size, modified: file.lastModified, state: "hashing", sent: 0, ...judge(name) };
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
      const item = { ...row, sent: 0, state: "lost" };
      this.items.push(item);
      if (row.file && (await readable(row.file))) Object.assign(item, { state: "waiting" });
      else delete item.file;
    }
    if (rows.length) {
      await this.ask(this.items.filter((item) => item.state === "waiting"), "waiting");
      this.sending = true;
      this.pump();
      this.changed();
    }
    return rows.length;
  }

  /** Send everything that is ready. */
  async send() {
    for (const item of this.items.filter((each) => each.state === "failed" && !each.sha256)) this.hash(Object.assign(item, { state: "hashing", error: undefined }));
    const ready = this.items.filter((item) => ["ready", "failed"].includes(item.state));
    for (const item of ready) Object.assign(item, { state: "waiting", error: undefined });
    this.sending = true;
    this.changed();
    // begun before all is written down: the first bytes need not wait for the journal
    this.pump();
    await this.journal.add(ready.filter((item) => ["waiting", "sending"].includes(item.state)));
    await this.journal.clear(ready.filter((item) => item.state === "sent").map((item) => item.key));
  }

  retryNow() {
    for (const item of this.items) if (item.state === "retrying") this.again(item);
    this.pump();
  }

  /** Leave out what has not been sent. */
  async drop(items) {
    for (const item of items) item.abort?.abort();
    this.items = this.items.filter((item) => !items.includes(item));
    await this.journal.clear(items.map((item) => item.key));
    this.changed();
  }

  pump() {
    while (this.sending && this.items.filter((item) => item.state === "sending").length < AT_ONCE) {
      const next = this.items.find((item) => item.state === "waiting");
      if (!next) break;
      this.sendOne(next);
    }
    if (!this.items.some((item) => ["waiting", "sending", "retrying"].includes(item.state))) this.sending = false;
    this.changed();
  }

  async sendOne(item) {
    item.state = "sending";
    item.abort = new AbortController();
    try {
      const frame = await sendFile(this.path, item, { signal: item.abort.signal, onProgress: (bytes) => this.progress(item, bytes) });
      this.progress(item, item.size);
      Object.assign(item, { state: "sent", frameId: frame.id, attempts: 0 });
      await this.journal.remove(item.key);
      this.dispatchEvent(new Event("sent"));
    } catch (error) {
      if (error.name === "AbortError") return;
      this.failed(item, error);
    }
    this.pump();
  }

  failed(item, error) {
    item.sent = 0;
    item.error = error.message;
    if (!error.retryable) {
      item.state = "failed";
      return;
    }
    item.state = "retrying";
    item.attempts = (item.attempts ?? 0) + 1;
    const pause = Math.min(1000 * 2 ** (item.attempts - 1), LONGEST_PAUSE_MS);
    item.timer = setTimeout(() => (this.again(item), this.pump()), pause);
  }

  again(item) {
    clearTimeout(item.timer);
    if (item.state === "retrying") item.state = "waiting";
  }

  progress(item, bytes) {
    this.moved.push([Date.now(), bytes - item.sent]);
    item.sent = bytes;
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
    const asking = this.items.filter((each) => each.state === "asking");
    const last = !this.items.some((each) => each.state === "hashing");
    if (asking.length && (last || asking.length >= 50)) this.ask(asking, "ready");
    this.changed();
  }

  /** Which of them the service has already; the others become `then`. */
  async ask(items, then) {
    for (let at = 0; at < items.length; at += ASK_AT_MOST) {
      const some = items.slice(at, at + ASK_AT_MOST);
      let known = new Map();
      try {
        const answer = await post(`${this.path}/frames/known`, { sha256: some.map((item) => item.sha256) });
        known = new Map(answer.known.map((each) => [each.sha256, each]));
      } catch (error) {
        // without an answer they are sent, and the service finds out by itself
        if (!error.code) throw error;
      }
      for (const item of some) {
        const there = known.get(item.sha256);
        if (there && there.state !== "refused") {
          Object.assign(item, { state: "there", frameId: there.frame_id, sent: item.size });
          await this.journal.remove(item.key);
        } else item.state = then;
      }
    }
    this.changed();
  }

  lost(file, name) {
    const own = name.split("/").at(-1);
    return this.items.find((item) => item.state === "lost" && item.size === file.size && item.modified === file.lastModified && item.name.split("/").at(-1) === own);
  }

  find(item, file) {
    Object.assign(item, { file, state: "waiting" });
    this.sending = true;
    this.pump();
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
