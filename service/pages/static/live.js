// What changes while one looks: followed without reloading, at rest while nobody looks.

import { get } from "./api.js";
import { byId, h } from "./dom.js";

const LOCK = "stilb events";

/**
 * Call `news(hears)` at each event while the page is seen, and once when none comes any more. Of all tabs one listens:
 * where that is another one, where the browser has no locks (plain http) or a proxy holds events back, none comes.
 */
function listen(address, kind, news) {
  let over = null;
  let hears = false;

  function begin() {
    if (over || document.hidden || !navigator.locks) return;
    const own = (over = new AbortController());
    const { signal } = own;
    const hold = () => new Promise((done) => {
      const source = new EventSource(address);
      const end = () => {
        source.close();
        done();
      };
      source.addEventListener(kind, () => news((hears = true)));
      source.addEventListener("error", () => {
        if (hears) news((hears = false));
        if (source.readyState === EventSource.CLOSED) end();
      });
      signal.addEventListener("abort", end);
    });
    navigator.locks.request(LOCK, { signal }, hold).catch(() => {});
  }
  function end() {
    over?.abort();
    over = null;
    if (hears) news((hears = false));
  }
  const turn = () => (document.hidden ? end() : begin());
  document.addEventListener("visibilitychange", turn);
  begin();
  return () => {
    document.removeEventListener("visibilitychange", turn);
    end();
  };
}

const ENDED = ["succeeded", "failed", "quarantined"];
const LONGEST_MS = 30000;
/** Events that come at once are answered by one look. */
const LEAST_MS = 1000;
/** A connection that died without a word is given up, and another asked. */
const ANSWERS_WITHIN_MS = 20000;

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

/**
 * Call `look` now and every so often while the page is seen; it may be slow, and may fail. Answers {stop, now}.
 * With `events`, {address, kind}, it is called when something has happened, and seldom besides.
 */
export function follow(look, { every = 3000, events } = {}) {
  let timer;
  let stopped = false;
  let delay = every;
  let begun = 0;
  let rests = 0;
  let looking = 0;
  let hears = false;
  let news = false;
  async function turn() {
    const own = (begun += 1);
    const begunAt = performance.now();
    clearTimeout(timer);
    if (stopped) return;
    if (!document.hidden) {
      news = false;
      looking += 1;
      try {
        await look();
        delay = every;
        tellLost(false);
      } catch (error) {
        if (!error.code) throw error;
        delay = Math.min(delay * 2, LONGEST_MS);
        tellLost(error.retryable);
      } finally {
        looking -= 1;
        // what takes long to answer is asked for less often
        rests = performance.now() + Math.max(LEAST_MS, performance.now() - begunAt);
      }
    }
    // one that was asked for meanwhile goes on instead
    if (own === begun) plan();
  }
  function plan() {
    clearTimeout(timer);
    const wait = hears ? LONGEST_MS : delay;
    if (!stopped) timer = setTimeout(turn, news ? Math.max(0, rests - performance.now()) : wait);
  }
  const seen = () => !document.hidden && turn();
  document.addEventListener("visibilitychange", seen);
  const deaf = events && listen(events.address, events.kind, (listens) => {
    [hears, news] = [listens, true];
    if (!looking) plan();
  });
  const stop = () => {
    stopped = true;
    clearTimeout(timer);
    deaf?.();
    document.removeEventListener("visibilitychange", seen);
  };
  // another page is shown in this document (handover.js)
  addEventListener("left", stop, { once: true });
  turn();
  return { stop, now: turn };
}

/** While nothing comes any more, what is shown may be old: say so. */
function tellLost(lost) {
  const told = byId("lost");
  if (lost && !told) document.body.append(h("p", { id: "lost", class: "note warn", role: "status" }, h("strong", {}, "The service does not answer. "), "The content may be outdated. It is updated automatically."));
  if (!lost) told?.remove();
}

/** Answers may come in another order than they were asked for: only one that was asked for later than what is shown is taken. */
export class Turns {
  asked = 0;
  taken = 0;
  ask() {
    return (this.asked += 1);
  }
  take(turn = this.asked) {
    const newer = turn > this.taken;
    if (newer) this.taken = turn;
    return newer;
  }
}

export const pause = (ms) => new Promise((done) => setTimeout(done, ms));
