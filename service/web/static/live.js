// What changes while one looks: followed without reloading, at rest while nobody looks.

import { get } from "./api.js";
import { byId, h } from "./dom.js";

const ENDED = ["succeeded", "failed", "quarantined"];
const LONGEST_MS = 30000;

/** Wait for a job; `onProgress(job)` hears of it every other second. Answers the job as it ended. */
export async function followJob(id, onProgress = () => {}, { signal } = {}) {
  for (let misses = 0; ; ) {
    try {
      // it answers at once when the job ends, and with its progress after two seconds
      const job = await get(`/v1/jobs/${id}`, { headers: { Prefer: "wait=2" }, signal });
      misses = 0;
      onProgress(job);
      if (ENDED.includes(job.state)) return job;
    } catch (error) {
      if (!error.retryable || ++misses > 30) throw error;
      await pause(Math.min(1000 * misses, 5000));
    }
  }
}

/** Call `look` now and every so often while the page is seen; it may be slow, and may fail. Answers {stop, now}. */
export function follow(look, { every = 3000 } = {}) {
  let timer;
  let stopped = false;
  let delay = every;
  let begun = 0;
  async function turn() {
    const own = (begun += 1);
    clearTimeout(timer);
    if (stopped) return;
    if (!document.hidden) {
      try {
        await look();
        delay = every;
        tellLost(false);
      } catch (error) {
        if (!error.code) throw error;
        delay = Math.min(delay * 2, LONGEST_MS);
        tellLost(error.retryable);
      }
    }
    // one that was asked for meanwhile goes on instead
    if (!stopped && own === begun) timer = setTimeout(turn, delay);
  }
  const seen = () => !document.hidden && turn();
  document.addEventListener("visibilitychange", seen);
  const stop = () => {
    stopped = true;
    clearTimeout(timer);
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
