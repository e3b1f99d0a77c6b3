import { all, follow, get, getOr, post } from "../api.js";
import { nameOf } from "../methods.js";
import { causeList, jobCause, small } from "../causes.js";
import { act, byId, done, empty, failed, fill, h, isPressed, mark, may, table, toast } from "../dom.js";
import { ago, bytes, counted, groupBy, number, percent, span, tag, time } from "../format.js";

const SLOW_S = 600;
const NARROW = 0.1;
const FULL = 0.03;

/** Figures with a mark each: [mark, name, value, note]. */
const drawHealth = (queue, causes, ready, operator) =>
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
  return [kind, "Workers", `${working} of ${workers.length}`, hung.length ? `${hung.map((part) => part.kind).join(", ")} hangs` : working ? "ready" : "jobs wait"];
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

const SCOPES = { extract: "upload", fit: "calibrate", measure: "upload" };

/** The causes as lines; `changed` is called after each press that changed something. */
function listFailures(causes, works, changed) {
  if (!causes.length) return empty("No failed jobs", "Jobs that fail are listed here with their reason.");
  return causeList(causes.map((cause) => {
    const line = jobCause(cause, works);
    return { ...line, actions: may(SCOPES[cause.newest.kind]) ? [...line.actions, ...buttons(cause, line.title, changed)] : line.actions };
  }));
}

function buttons({ newest: { state, kind, error, campaign_id } }, title, changed) {
  const chosen = { state, kind, ...(error ? { code: error.code } : {}), ...(campaign_id ? { campaign_id } : {}) };
  const dismiss = (dismissed) => post("/v1/jobs/dismiss", { ...chosen, dismissed });
  const retry = small("Retry", () => act(retry, async () => {
    const { retried } = await post("/v1/jobs/retry", chosen);
    toast(`Retrying ${counted(retried, "job")}.`);
    await changed();
  }), { "aria-label": `Retry: ${title}` });
  const away = small("Dismiss", () => act(away, async () => {
    await dismiss(true);
    done("Dismissed.", async () => {
      await dismiss(false);
      await changed();
    });
    await changed();
  }), { quiet: true, "aria-label": `Dismiss: ${title}` });
  return [retry, away];
}

const KINDS = { extract: "Read", fit: "Fit of", measure: "Measure" };
const DONE = { extract: ["frame", " read"], fit: ["fit", ""], measure: ["measurement", ""] };
const SHOWN = 100;
const unfolded = new Set();
const HEALTH_EVERY_MS = 10000;

let known = "";
let campaigns = [];
let operator = null;
let operatorAt = -Infinity;

const look = follow(
  async () => {
    try {
      const [queue, ready, recent, { items: causes }] = await Promise.all([
        get("/v1/jobs/summary"),
        getOr("/readyz", {}).catch((problem) => ({ problem })),
        get(`/v1/jobs?limit=${SHOWN}`),
        get("/v1/jobs/causes"),
        askOperator(),
      ]);
      show("health", drawHealth(queue, causes, ready, operator));
      // a list that is redrawn loses the place of who reads it: only when something changed
      const seen = JSON.stringify([recent.items, causes]);
      if (seen !== known && !isPressed(byId("failures"))) {
        await knowCampaigns([...recent.items, ...causes.map((cause) => cause.newest)]);
        known = seen;
        show("failures", listFailures(causes, campaigns, look));
        drawRecent(recent.items);
      }
    } catch (error) {
      byId("health").removeAttribute("aria-busy");
      if (!known) for (const id of ["failures", "recent"]) show(id, failed(error, look));
      throw error;
    }
  },
  { every: 2000 },
);

/** What only the operator may ask, and less often: it counts over all organisations. */
async function askOperator() {
  if (!byId("health").dataset.operator || performance.now() - operatorAt < HEALTH_EVERY_MS) return;
  operatorAt = performance.now();
  operator = await get("/v1/health");
}

function drawRecent(jobs) {
  if (!jobs.length) {
    show("recent", empty("No jobs yet", "Each uploaded frame and each requested fit becomes a job."));
    return;
  }
  const columns = [
    { head: "Job", header: true, cell: what },
    { head: "State", cell: state },
    { head: "Requested", cell: (job) => h("span", { title: job.created_at, class: "nowrap" }, ago(job.created_at)) },
    { head: "Duration", class: "number", cell: took },
    { head: "Attempts", class: "number", cell: (job) => number(job.attempt) },
  ];
  const [done, open] = [true, false].map((wanted) => jobs.filter((job) => (job.state === "succeeded") === wanted));
  const groups = groupBy(done, (job) => job.campaign_id ?? "");
  show("recent", [open.length ? table(columns, open, { caption: "Running, waiting and failed jobs", stack: true }) : null, [...groups].map(([id, some]) => folded(id, some, table(columns, some, { caption: "Finished jobs", stack: true })))]);
}

function folded(id, some, content) {
  const kinds = [...groupBy(some, (job) => DONE[job.kind] ?? [job.kind, ""])].map(([[noun, did], { length }]) => `${counted(length, noun)}${did}`);
  const typical = some.map(lasted).sort((a, b) => a - b)[some.length >> 1];
  const details = h("details", { class: "fold", open: unfolded.has(id), ontoggle: () => (details.open ? unfolded.add(id) : unfolded.delete(id)) }, h("summary", { "data-keep": `finished ${id}` }, id ? nameOf(campaigns, id) : "Other jobs", h("span", { class: "muted" }, ` ${kinds.join(", ")} · median ${span(typical)}`)), content);
  return details;
}

async function knowCampaigns(jobs) {
  const named = new Set(campaigns.map((each) => each.id));
  if (jobs.some((job) => job.campaign_id && !named.has(job.campaign_id))) campaigns = await all("/v1/campaigns");
}

function what(job) {
  const about = job.filename ?? (job.campaign_id ? nameOf(campaigns, job.campaign_id) : "");
  return h("span", {}, `${KINDS[job.kind] ?? job.kind} `, job.campaign_id ? h("a", { href: `/campaigns/${job.campaign_id}` }, about) : about);
}

function state(job) {
  if (job.next_attempt_at) return h("span", { title: job.error.detail }, tag(job.state), " next attempt ", time(job.next_attempt_at));
  if (job.dismissed_at) return [tag(job.state), " ", h("span", { class: "muted small" }, "dismissed")];
  if (job.state !== "running") return tag(job.state);
  const bar = h("progress", { max: "1", value: String(job.progress), "aria-label": "Progress" });
  return h("span", { class: "running" }, tag(job.state), bar);
}

const lasted = (job) => (new Date(job.finished_at) - new Date(job.created_at)) / 1000;
const took = (job) => (job.finished_at ? span(lasted(job)) : "–");

function show(id, content) {
  const region = byId(id);
  fill(region, content);
  region.removeAttribute("aria-busy");
}
