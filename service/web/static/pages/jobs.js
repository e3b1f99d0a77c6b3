import { all, get, getOr, post } from "../api.js";
import { byId, figure, fill, h, may, table, toast } from "../dom.js";
import { nameOf } from "../campaign/named.js";
import { ago, number, span, tag, time } from "../format.js";
import { follow } from "../live.js";
import { act, empty, failed } from "../states.js";

const KINDS = { extract: "Read", fit: "Fit of", measure: "Measure" };
const SCOPES = { extract: "upload", fit: "calibrate", measure: "upload" };
const SHOWN = 30;

let known = "";
let campaigns = [];

const followed = follow(
  async () => {
    try {
      const [queue, health, recent, lost, broken] = await Promise.all([
        get("/v1/jobs/summary"),
        getOr("/readyz", {}).catch((problem) => ({ problem })),
        get(`/v1/jobs?limit=${SHOWN}`),
        all("/v1/jobs?state=quarantined", { atMost: 200 }),
        all("/v1/jobs?state=failed", { limit: 100, atMost: 100 }),
      ]);
      drawQueue(queue, health);
      // a table that is redrawn loses the place of who reads it: only when something changed
      const seen = JSON.stringify([recent.items, lost, broken]);
      if (seen !== known) {
        known = seen;
        await knowCampaigns([...recent.items, ...lost, ...broken]);
        drawFailures([...lost, ...broken]);
        drawRecent(recent.items);
      }
    } catch (error) {
      if (!known) for (const id of ["queue", "failures", "recent"]) show(id, failed(error, followed.now));
      throw error;
    }
  },
  { every: 2000 },
);

function drawQueue(queue, health) {
  const count = (state) => `${queue.more.includes(state) ? "more than " : ""}${number(queue[state])}`;
  show(
    "queue",
    h(
      "dl",
      { class: "figures" },
      figure("Waiting", count("queued"), queue.queued ? `the oldest for ${span(queue.oldest_wait_s)}` : "none waiting"),
      figure("Running", count("running")),
      figure("Done", count("succeeded")),
      figure("Failed", count("failed")),
      figure("Quarantined", count("quarantined")),
      figure("Service", health.problem ? tag("not ready", "bad") : tag("ready", "good"), health.problem?.message),
    ),
  );
}

function drawFailures(jobs) {
  if (!jobs.length) {
    show("failures", empty("No failed jobs", "Jobs that fail are listed here with their reason."));
    return;
  }
  const columns = [
    { head: "Job", header: true, cell: what },
    { head: "State", cell: (job) => tag(job.state) },
    { head: "Reason", cell: reason },
    { head: "Time", cell: (job) => time(job.finished_at) },
    { head: "", cell: retryButton },
  ];
  show("failures", table(columns, jobs, { caption: "Failed and quarantined jobs", stack: true }));
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

const aboutOf = (job) => job.filename ?? (job.campaign_id ? nameOf(campaigns, job.campaign_id) : "");

function what(job) {
  const about = aboutOf(job);
  return h(
    "span",
    {},
    `${KINDS[job.kind] ?? job.kind} `,
    job.campaign_id ? h("a", { href: `/campaigns/${job.campaign_id}` }, about) : about,
  );
}

function state(job) {
  if (job.next_attempt_at) return h("span", { title: job.error.detail }, tag(job.state), " next attempt ", time(job.next_attempt_at));
  if (job.state !== "running") return tag(job.state);
  const bar = h("progress", { max: "1", value: String(job.progress), "aria-label": "Progress" });
  return h("span", { class: "running" }, tag(job.state), bar);
}

function reason(job) {
  if (!job.error) return "–";
  return h("span", {}, job.error.detail, " ", h("a", { class: "small nowrap", href: job.error.type }, job.error.title.toLowerCase()));
}

function took(job) {
  return job.finished_at ? span((new Date(job.finished_at) - new Date(job.created_at)) / 1000) : "–";
}

function retryButton(job) {
  if (!may(SCOPES[job.kind])) return "";
  const label = `Retry: ${KINDS[job.kind] ?? job.kind} ${aboutOf(job)}`;
  const button = h("button", { type: "button", "aria-label": label.trim() }, "Retry");
  button.addEventListener("click", () =>
    act(button, async () => {
      await post(`/v1/jobs/${job.id}/retry`);
      toast("The job is queued again.");
      await followed.now();
    }),
  );
  return button;
}

function show(id, content) {
  const region = byId(id);
  fill(region, content);
  region.removeAttribute("aria-busy");
}
