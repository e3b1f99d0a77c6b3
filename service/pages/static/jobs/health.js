// How the work goes on: the queue, and for the operator workers, disk and stored files.

import { h } from "../dom.js";
import { bytes, counted, number, percent, span } from "../format.js";
import { mark } from "../marks.js";

const SLOW_S = 600;
const NARROW = 0.1;
const FULL = 0.03;

/** Figures with a mark each: [mark, name, value, note]. */
export const drawHealth = (queue, causes, ready, operator) =>
  [queueOf(operator ? { queued: operator.jobs_waiting, running: operator.jobs_running, oldest_wait_s: operator.oldest_wait_s } : queue), failuresOf(causes, queue), ...(operator ? [workersOf(operator), diskOf(operator), filesOf(operator)] : [serviceOf(ready)])].map(([kind, name, value, note]) => h("div", {}, h("dt", {}, mark(kind), " ", name), h("dd", {}, value, h("small", {}, note))));

function queueOf({ queued, running, oldest_wait_s: wait, more = [] }) {
  const count = (state, value) => `${more.includes(state) ? "more than " : ""}${number(value, 7)}`;
  const kind = wait > SLOW_S ? "warn" : queued || running ? "wait" : "good";
  return [kind, "Queue", queued ? `${count("queued", queued)} waiting` : "none waiting", [queued ? `the oldest for ${span(wait)}` : null, running ? `${count("running", running)} running` : null].filter(Boolean).join(", ") || "nothing runs"];
}

function failuresOf(causes, { succeeded, more }) {
  const count = causes.reduce((sum, cause) => sum + cause.count, 0);
  return [count ? "bad" : "good", "To mend", counted(count, "failure"), count ? counted(causes.length, "cause") : `${more.includes("succeeded") ? "more than " : ""}${number(succeeded, 7)} succeeded`];
}

function serviceOf({ problem, warnings = [] }) {
  return problem ? ["bad", "Service", "not ready", problem.message] : [warnings.length ? "warn" : "good", "Service", "ready", warnings.join(", ") || "no warnings"];
}

function workersOf({ parts }) {
  const workers = parts.filter((part) => part.kind === "worker");
  const working = workers.filter((part) => part.state === "working").length;
  const hung = parts.filter((part) => part.state === "hung");
  const kind = !working || hung.length ? "bad" : "good";
  return [kind, "Workers", `${working} of ${workers.length}`, hung.length ? `${hung.map((part) => part.kind).join(", ")} hangs` : working ? "all at work" : "jobs wait"];
}

function diskOf({ disk_free_bytes: free, disk_total_bytes: total }) {
  const left = free / total;
  return [left < FULL ? "bad" : left < NARROW ? "warn" : "good", "Disk", `${percent(1 - left)} full`, `${bytes(free)} free`];
}

function filesOf({ files, damaged_files: damaged, oldest_proof_s: age, verified_within_s: within }) {
  const late = within && age > 2 * within;
  const note = damaged ? `${counted(damaged, "file")} damaged or missing` : !files ? "nothing to verify" : !within ? "not verified regularly" : `all verified within ${span(age)}`;
  return [damaged ? "bad" : late || (!within && files) ? "warn" : "good", "Stored files", number(files, 9), late ? `${note}, longer than the ${span(within)} set` : note];
}
