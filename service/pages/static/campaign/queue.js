// The files that the page was given: hashed, compared with what the service has, and sent meanwhile.

import { Problem, isRenewed, newOnce, post, send } from "../api.js";

/** A smaller file is sent again whole. */
const WHOLE_BYTES = 1 << 20;
const TUS = { "Tus-Resumable": "1.0.0" };

/**
 * Send a file; answers the frame's {id}, or throws a Problem. `onProgress(bytes)` hears how far it is. `onBegun()` hears
 * that the service answers, and that `item.upload` is the address at which a cut upload goes on.
 */
async function sendFile(path, item, { onProgress, onBegun, signal }) {
  const said = { role: item.role, filename: item.name.split("/").at(-1), ...(item.scene ? { scene: item.scene } : {}) };
  if (!item.upload && (item.size <= WHOLE_BYTES || !item.sha256)) {
    const headers = { "Content-Type": "application/octet-stream", ...(item.sha256 ? { "X-Content-SHA256": item.sha256 } : {}) };
    return (await ask("POST", `${path}/frames?${new URLSearchParams(said)}`, headers, { body: item.file, onProgress, signal })).response;
  }
  if (!item.upload) {
    item.once ??= newOnce();
    const told = { campaign_id: path.split("/").at(-1), sha256: item.sha256, ...said };
    const metadata = Object.entries(told).map(([name, text]) => `${name} ${btoa(String.fromCharCode(...new TextEncoder().encode(text)))}`);
    const begun = await ask("POST", "/v1/uploads", { ...TUS, "Upload-Length": item.size, "Upload-Metadata": metadata.join(","), "Idempotency-Key": item.once }, { signal });
    item.upload = begun.getResponseHeader("Location");
  }
  try {
    let answer = await ask("HEAD", item.upload, TUS, { signal });
    onBegun();
    const offset = Number(answer.getResponseHeader("Upload-Offset"));
    item.sent = offset;
    if (!answer.getResponseHeader("Content-Location")) {
      const headers = { ...TUS, "Content-Type": "application/offset+octet-stream", "Upload-Offset": offset };
      answer = await ask("PATCH", item.upload, headers, { body: item.file.slice(offset), onProgress: (bytes) => onProgress(offset + bytes), signal });
    }
    return { id: answer.getResponseHeader("Content-Location").split("/").at(-1) };
  } catch (error) {
    // it was ended or has expired: from the start; or more had arrived than was known: from there
    if (error.status === 404) Object.assign(item, { upload: undefined, once: undefined });
    if ([404, 409].includes(error.status)) error.retryable = true;
    throw error;
  }
}

/** A request as it was answered; the browser streams its body. Without a session it waits for one. */
function ask(method, address, headers, options = {}) {
  const { body, onProgress, signal } = options;
  return new Promise((done, fail) => {
    const request = new XMLHttpRequest();
    request.open(method, address);
    for (const [name, value] of Object.entries({ ...headers, "X-CSRF-Token": document.querySelector("meta[name=csrf-token]").content })) request.setRequestHeader(name, value);
    request.responseType = "json";
    if (onProgress) request.upload.onprogress = (event) => onProgress(event.loaded);
    request.onload = async () => {
      if (request.status < 300) done(request);
      else if (request.status === 401 && (await isRenewed(false))) done(ask(method, address, headers, options));
      else fail(problemOf(request));
    };
    request.onerror = () => fail(new Problem({ title: "No connection", detail: "The connection was lost.", code: "offline", status: 0, retryable: true }));
    request.onabort = () => fail(new DOMException("stopped", "AbortError"));
    signal?.addEventListener("abort", () => request.abort());
    request.send(body);
  });
}

function problemOf({ status, response }) {
  if (response?.detail) return new Problem({ ...response, status, retryable: response.retryable || status >= 500 || status === 401 });
  return new Problem({ title: "Not accepted", detail: `The service answered ${status}.`, code: "unknown", status, retryable: status >= 500 });
}

const BUDGET = 4e9;

/** The journal of one campaign. Where the browser keeps nothing (a private window), it forgets with the page. */
class Journal {
  constructor(campaignId) {
    this.campaignId = campaignId;
    this.kept = 0;
    this.opened = open().catch(() => null);
  }

  /** Everything that was to be sent: {key, name, size, modified, role, scene, sha256, upload?, file?}. */
  async read() {
    const rows = (await this.run("readonly", (store) => store.getAll())) ?? [];
    const own = rows.filter((row) => row.campaignId === this.campaignId);
    this.kept = own.reduce((sum, row) => sum + (row.file ? row.size : 0), 0);
    return own;
  }

  /** The file itself is kept too, up to a few gigabytes in all: then nobody need choose it again. */
  async add(items) {
    for (const item of items) {
      const { key, name, size, modified, role, scene, sha256, upload, file } = item;
      const row = { id: `${this.campaignId} ${key}`, campaignId: this.campaignId, key, name, size, modified, role, scene, sha256, upload };
      const fits = this.kept + size <= BUDGET;
      const stored = fits && (await this.run("readwrite", (store) => store.put({ ...row, file })));
      if (stored) this.kept += size;
      else await this.run("readwrite", (store) => store.put(row));
    }
  }

  /** Where a file's upload goes on; one that is not written down yet is with it then. */
  async note({ key, upload }) {
    const row = await this.run("readonly", (store) => store.get(`${this.campaignId} ${key}`));
    if (row?.key) await this.run("readwrite", (store) => store.put({ ...row, upload }));
  }

  async clear(...keys) {
    for (const key of keys) await this.run("readwrite", (store) => store.delete(`${this.campaignId} ${key}`));
  }

  async run(mode, work) {
    const database = await this.opened;
    if (!database) return undefined;
    return new Promise((done) => {
      const transaction = database.transaction("files", mode);
      const asked = work(transaction.objectStore("files"));
      transaction.oncomplete = () => done(asked.result ?? true);
      transaction.onerror = transaction.onabort = (event) => (event.preventDefault(), done(undefined));
    });
  }
}

function open() {
  return new Promise((done, fail) => {
    const asked = indexedDB.open("stilb-uploads", 1);
    asked.onupgradeneeded = () => asked.result.createObjectStore("files", { keyPath: "id" });
    asked.onsuccess = () => done(asked.result);
    asked.onerror = () => fail(asked.error);
  });
}

const AT_ONCE = 2;
/** Of small files: a browser has six connections, and the page asks meanwhile. */
const MOST_AT_ONCE = 4;
const STALLED_MS = 30000;
/** Longer than what a slow line holds under way needs. */
const SILENT_MS = 120000;
/** Without a connection it is looked for so often, by one file for all. */
const LOOK_AGAIN_MS = 2000;
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
    this.accepted = new Set(); // codes of refusals despite which the rest is sent
    addEventListener("online", () => this.retryNow());
    // a phone that has slept does not know which of its connections still lead anywhere
    document.addEventListener("visibilitychange", () => document.hidden || this.retryNow());
    // one that has died without a word ends at no time of itself
    setInterval(() => this.giveUp(SILENT_MS) && this.pump(), STALLED_MS / 3);
  }

  /** Files with their paths: [{file, name, role, scene}]. Answers how many were new. */
  add(files) {
    const before = this.items.length;
    for (const { file, name, role, scene } of files) {
      const key = `${name} ${file.size} ${file.lastModified}`;
      const known = this.items.find((item) => item.key === key) ?? this.lost(file, name);
      if (known) {
        if (known.state === "lost") this.takeBack(known, file);
        continue;
      }
      const item = { key, name, file, size: file.size, modified: file.lastModified, state: "hashing", sent: 0, role, scene };
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
    await this.journal.clear(...open.filter((item) => !item.armed || ["sent", "there"].includes(item.state)).map((item) => item.key));
  }

  async stop() {
    const held = this.items.filter((item) => item.armed && OPEN.includes(item.state));
    for (const item of held) {
      item.abort?.abort();
      Object.assign(item, { armed: false, sent: 0, state: ["hashing", "asking"].includes(item.state) ? item.state : "ready" });
    }
    this.changed();
    await this.journal.clear(...held.map((item) => item.key));
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
    for (const item of this.inTurn("retrying")) item.state = "waiting";
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

  async drop(items) {
    for (const item of items) {
      item.abort?.abort();
      if (item.upload && item.state !== "sent") send("DELETE", item.upload).catch(() => {});
    }
    this.items = this.items.filter((item) => !items.includes(item));
    await this.journal.clear(...items.map((item) => item.key));
    this.changed();
  }

  pump() {
    const sending = this.items.filter((item) => item.state === "sending");
    for (const next of this.inTurn("waiting")) {
      const small = [...sending, next].every((item) => item.size < WHOLE_BYTES);
      if (sending.length >= (small ? MOST_AT_ONCE : AT_ONCE)) break;
      sending.push(next);
      this.sendOne(next);
    }
    this.changed();
  }

  async sendOne(item) {
    Object.assign(item, { state: "sending", movedAt: Date.now() });
    item.abort = new AbortController();
    try {
      const onBegun = () => (this.journal.note(item), this.find(), this.pump());
      const frame = await sendFile(this.path, item, { signal: item.abort.signal, onProgress: (bytes) => this.progress(item, bytes), onBegun });
      this.progress(item, item.size);
      Object.assign(item, { state: "sent", frameId: frame.id });
      this.find();
      await this.journal.clear(item.key);
    } catch (error) {
      if (error.name === "AbortError") return;
      this.failed(item, error);
    }
    this.pump();
  }

  failed(item, error) {
    if (!item.upload) item.sent = 0;
    item.error = error.message;
    if (error.retryable) {
      Object.assign(item, { state: "retrying", failedAt: Date.now() });
      return this.lose(error.code === "offline");
    }
    this.find();
    Object.assign(item, { state: "failed", armed: false });
    this.refuse(item, error);
  }

  /** The service takes nothing, or there is no connection to it: all wait, and one file at a time looks for it. */
  lose(isOffline) {
    if (isOffline) this.lostSince ??= Date.now();
    for (const each of this.items) if (each.state === "waiting") each.state = "retrying";
    this.looking ??= setInterval(() => {
      const [first] = this.inTurn("retrying");
      if (!first || this.items.some((each) => each.state === "sending")) return;
      first.state = "waiting";
      this.pump();
    }, LOOK_AGAIN_MS);
  }

  /** The service answers. */
  find() {
    clearInterval(this.looking);
    this.looking = this.lostSince = undefined;
    for (const each of this.inTurn("retrying")) each.state = "waiting";
  }

  /** What failed last comes last, so that a file which the service fails at holds up no other. */
  inTurn(state) {
    return this.items.filter((item) => item.state === state).sort((a, b) => (a.failedAt ?? 0) - (b.failedAt ?? 0));
  }

  progress(item, bytes) {
    this.moved.push([Date.now(), bytes - item.sent]);
    Object.assign(item, { sent: bytes, movedAt: Date.now() });
    this.changed();
  }

  get rate() {
    const since = Date.now() - 10000;
    this.moved = this.moved.filter(([at]) => at > since);
    const from = this.moved[0]?.[0];
    return from ? this.moved.reduce((sum, [, count]) => sum + count, 0) / Math.max(1, (Date.now() - from) / 1000) : 0;
  }

  hash(item) {
    this.hashers ??= startHasher((id, found) => this.hashed(id, found), () => this.hashAgain());
    this.hashers.postMessage({ id: item.key, file: item.file });
  }

  /** Without a connection the worker itself did not come. */
  hashAgain() {
    this.hashers = undefined;
    setTimeout(() => this.items.filter((item) => item.state === "hashing").forEach((item) => this.hash(item)), LOOK_AGAIN_MS);
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
          await this.journal.clear(item.key);
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

  takeBack(item, file) {
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

function startHasher(take, failed) {
  const worker = new Worker(new URL("./hash-worker.js", import.meta.url), { type: "module" });
  worker.onmessage = ({ data: { id, ...found } }) => take(id, found);
  worker.onerror = failed;
  return worker;
}
