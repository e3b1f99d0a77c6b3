import { all, get, getOr } from "../api.js";
import { byId, fill, h, isPressed, table } from "../dom.js";
import { lettersOn } from "../campaign/keys.js";
import { nameOf } from "../campaign/named.js";
import { ago, number, span, tag, time } from "../format.js";
import { drawHealth } from "../jobs/health.js";
import { listFailures } from "../jobs/failures.js";
import { follow } from "../live.js";
import { empty, failed } from "../states.js";
import { undoLast } from "../undo.js";

const KINDS = { extract: "Read", fit: "Fit of", measure: "Measure" };
const SHOWN = 30;
const HEALTH_EVERY_MS = 10000;

let known = "";
let campaigns = [];
let operator = null;
let operatorAt = -Infinity;

const followed = follow(
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
        show("failures", listFailures(causes, campaigns, () => followed.now()));
        drawRecent(recent.items);
      }
    } catch (error) {
      byId("health").removeAttribute("aria-busy");
      if (!known) for (const id of ["failures", "recent"]) show(id, failed(error, followed.now));
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
  show("recent", table(columns, jobs, { caption: "Recent jobs", stack: true }));
}

/** Jobs name their campaign by its id; people know its name. */
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

function took(job) {
  return job.finished_at ? span((new Date(job.finished_at) - new Date(job.created_at)) / 1000) : "–";
}

function show(id, content) {
  const region = byId(id);
  fill(region, content);
  region.removeAttribute("aria-busy");
}

addEventListener("keydown", (event) => {
  if (event.key === "z" && lettersOn() && !event.ctrlKey && !event.metaKey && !event.target.closest("input, select, textarea, dialog")) undoLast();
});
