// Requests to /v1, and what changes while one looks. The browser sends the session's cookie, and every change carries the page's token.

import { byId, h } from "./dom.js";

/** A problem of the API, or a connection that did not come about; `message` is for people. */
export class Problem extends Error {
  constructor(body) {
    super(body.detail);
    Object.assign(this, { title: body.title, code: body.code, status: body.status, errors: body.errors ?? [], retryable: Boolean(body.retryable) });
  }
}

export const OFFLINE = { title: "No connection", detail: "The service does not answer. Check the connection and try again.", code: "offline", status: 0, retryable: true };

const changing = new Set();

/** Note a change that is on its way: a job that is started after it waits for it. */
const change = (sent) => (changing.add(sent), sent.finally(() => changing.delete(sent)).catch(() => {}), sent);

/** Whether there is a session again after the end of one: asked for over the page, which keeps what was typed. */
export async function isRenewed(insists) {
  const { signInAgain } = await import("./session.js");
  return signInAgain(insists);
}

/** Send a request; `json` becomes its body. Answers the Response, or throws a Problem. */
export async function send(method, path, options = {}) {
  const { json, body, headers = {}, signal } = options;
  const all = new Headers({ Accept: "application/json", ...headers });
  if (json !== undefined) all.set("Content-Type", "application/json");
  if (method !== "GET") all.set("X-CSRF-Token", document.querySelector("meta[name=csrf-token]").content);
  let answer;
  try {
    const sent = fetch(path, { method, headers: all, body: json === undefined ? body : JSON.stringify(json), signal });
    answer = await (method === "GET" ? sent : change(sent));
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem(OFFLINE);
  }
  if (answer.ok || answer.status === 304) return answer;
  const problem = await problemOf(answer);
  if (problem.status === 401 && (await isRenewed(method !== "GET"))) return send(method, path, options);
  throw problem;
}

export const get = async (path, options) => (await send("GET", path, options)).json();
/** The same POST, sent again after a lost connection, is done once: give the same `once` again. */
export const post = async (path, json, { once = newOnce(), headers = {}, ...options } = {}) =>
  (await send("POST", path, { json, headers: { "Idempotency-Key": once, ...headers }, ...options })).json();
export const put = async (path, json, options) => (await send("PUT", path, { json, ...options })).json();
export const patch = async (path, json, options) => (await send("PATCH", path, { json, ...options })).json();

/** {tag, body}: what is there, or no body where it is as it was under this tag. */
export async function getChanged(path, tag) {
  const answer = await send("GET", path, tag ? { headers: { "If-None-Match": tag } } : {});
  return { tag: answer.headers.get("etag"), body: answer.status === 304 ? null : await answer.json() };
}

/** What is there, or `instead` where there is none (404). */
export async function getOr(path, instead) {
  try {
    return await get(path);
  } catch (error) {
    if (error.status === 404) return instead;
    throw error;
  }
}

/** The path of an address that the service gave: whole, or a path where it does not know its own name. */
export function pathOf(address) {
  const { pathname, search } = new URL(address, location.href);
  return pathname + search;
}

export async function all(path) {
  const items = [];
  let next = `${path}${path.includes("?") ? "&" : "?"}limit=1000`;
  while (next) {
    const page = await get(next);
    items.push(...page.items);
    next = page.next && pathOf(page.next);
  }
  return items;
}

/** The key of a request that is done once, however often it is sent. */
export function newOnce() {
  // randomUUID is only there on https and localhost
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

async function problemOf(answer) {
  try {
    return new Problem(await answer.json());
  } catch {
    const detail = `The service answered ${answer.status} with an unknown body. Try again.`;
    return new Problem({ title: "Unexpected answer", detail, code: "unknown", status: answer.status, retryable: true });
  }
}

const ENDED = ["succeeded", "failed", "quarantined"];
const LONGEST_MS = 30000;
/** A connection that died without a word is given up, and another asked. */
const ANSWERS_WITHIN_MS = 20000;

/** Start a job and wait for it, while `told` says how far it is; answers its result, or throws its problem. */
export async function runJob(path, body, told, doing, { signal } = {}) {
  const tell = ({ state, progress }) => (told.textContent = state === "queued" ? "Queued…" : `${doing}, ${Math.round(100 * progress)} %`);
  told.textContent = `${doing}…`;
  try {
    await Promise.allSettled(changing);
    const begun = await post(path, body, { signal });
    const job = begun.state === "succeeded" ? begun : await followJob(begun.id, tell, { signal });
    if (job.state !== "succeeded") throw new Problem(job.error);
    return job.result;
  } finally {
    if (!signal?.aborted) told.textContent = "";
  }
}

/** Wait for a job; `onProgress(job)` hears of it every other second. Answers the job as it ended. */
export async function followJob(id, onProgress = () => {}, { signal } = {}) {
  for (let misses = 0; ; ) {
    try {
      // it answers at once when the job ends, and with its progress after two seconds
      const job = await get(`/v1/jobs/${id}`, { headers: { Prefer: "wait=2" }, signal: AbortSignal.any([AbortSignal.timeout(ANSWERS_WITHIN_MS), ...(signal ? [signal] : [])]) });
      misses = 0;
      onProgress(job);
      if (ENDED.includes(job.state)) return job;
    } catch (error) {
      if (!error.retryable || ++misses > 30) throw error;
      await pause(Math.min(1000 * misses, 5000));
    }
  }
}

/** Call `look` now and every so often while the page is seen; it may be slow, and may fail. Answers what looks at once. */
export function follow(look, { every = 3000 } = {}) {
  let timer;
  let stopped = false;
  let delay = every;
  let begun = 0;
  async function turn() {
    const own = (begun += 1);
    const begunAt = performance.now();
    clearTimeout(timer);
    if (stopped) return;
    if (!document.hidden) {
      try {
        await look();
        delay = every;
        tellLost("");
      } catch (error) {
        if (!error.code) throw error;
        delay = Math.min(delay * 2, LONGEST_MS);
        tellLost(error.status === 401 ? "Your session has ended." : error.retryable ? "The service does not answer." : "");
      }
    }
    // one that was asked for meanwhile goes on instead; what takes long to answer is asked for less often
    if (own === begun && !stopped) timer = setTimeout(turn, Math.max(delay, performance.now() - begunAt));
  }
  const seen = () => !document.hidden && turn();
  document.addEventListener("visibilitychange", seen);
  // another page is shown in this document (drop.js)
  addEventListener("left", () => {
    stopped = true;
    clearTimeout(timer);
    document.removeEventListener("visibilitychange", seen);
  }, { once: true });
  turn();
  return turn;
}

/** While nothing comes any more, what is shown may be old: say so. */
function tellLost(why) {
  const told = byId("lost");
  if (told?.dataset.why === why) return;
  told?.remove();
  if (why) document.body.append(h("p", { id: "lost", class: "note warn", role: "status", "data-why": why }, h("strong", {}, why), " The content may be outdated. It is updated automatically."));
}

export const pause = (ms) => new Promise((done) => setTimeout(done, ms));
