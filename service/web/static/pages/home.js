import { all, get } from "../api.js";
import { byId, figure, h } from "../dom.js";
import { ago, counted, number, span, tag, words } from "../format.js";
import { nameOf, titleOf } from "../campaign/named.js";
import { inForce } from "../coefficients.js";
import { labelOf } from "../methods.js";
import { empty, load } from "../states.js";

const DAY_S = 86400;
const OLD_S = 365 * DAY_S;
const SOON_S = 60 * DAY_S;
const AT_MOST = 6;

const cameras = all("/v1/cameras");
const campaigns = all("/v1/campaigns");
const series = get("/v1/series/coefficients");
const queue = get("/v1/jobs/summary");

load(byId("figures"), () => Promise.all([cameras, campaigns, series, queue]), ([bodies, works, { rows }, jobs]) => {
  const linked = (href, name, count, more) => figure(h("a", { href }, name), number(count), more);
  const held = inForce(rows);
  const flagged = held.filter((each) => each.flags.length).length;
  return h(
    "dl",
    { class: "figures" },
    linked("/cameras", "Cameras", bodies.length, `${counted(held.length, "version")} in force${flagged ? `, ${flagged} with flags` : ""}`),
    linked("/campaigns", "Campaigns", works.length),
    linked("/jobs", "Jobs waiting", jobs.queued + jobs.running, jobs.queued ? `the oldest for ${span(jobs.oldest_wait_s)}` : "none waiting"),
    linked("/jobs", "Jobs failed", jobs.failed + jobs.quarantined),
  );
});

load(byId("failed-jobs"), () => Promise.all([get(`/v1/jobs?state=quarantined&limit=${AT_MOST}`), get(`/v1/jobs?state=failed&limit=${AT_MOST}`), campaigns]), ([lost, broken, works]) =>
  list(
    [...lost.items, ...broken.items].map((job) => ({
      href: job.campaign_id ? `/campaigns/${job.campaign_id}` : "/jobs",
      title: job.filename ?? (job.kind === "fit" ? `Fit of ${nameOf(works, job.campaign_id)}` : words(job.kind)),
      said: job.error?.detail ?? "",
      tag: tag(job.state),
    })),
    empty("No failed jobs"),
  ),
);

load(byId("campaigns"), latestCampaigns, (works) =>
  list(
    works.map(({ campaign, camera }) => ({
      href: `/campaigns/${campaign.id}`,
      title: titleOf(campaign),
      said: campaign.missing.length ? `Missing: ${campaign.missing.slice(0, 2).join("; ")}${campaign.missing.length > 2 ? ` and ${campaign.missing.length - 2} more` : ""}` : `Ready to fit: ${campaign.frames.extracted} frames of ${camera?.model ?? "its camera"}`,
      tag: campaign.missing.length ? tag(`${campaign.missing.length} missing`, "warn") : tag("ready", "good"),
    })),
    empty("No campaigns in progress", "A campaign contains the frames and readings of one calibration."),
  ),
);

load(byId("cameras"), () => Promise.all([cameras, series]), ([bodies, { rows }]) =>
  list(bodies.flatMap((camera) => attention(camera, rows)), empty(bodies.length ? "No camera needs attention" : "No cameras yet", bodies.length ? "" : "Register a camera, or create a campaign, which asks for its camera.", bodies.length ? null : h("a", { class: "button", href: "/cameras" }, "Cameras"))),
);

load(byId("meters"), () => all("/v1/meters"), (meters) =>
  list(
    meters.filter((meter) => !meter.certificate || left(meter) < SOON_S).map((meter) => ({
      title: `${meter.make} ${meter.model} ${meter.serial}`,
      said: meter.certificate ? `Certificate ${meter.certificate.number} ${left(meter) < 0 ? "expired" : "expires"} on ${meter.certificate.due_on}` : "No certificate: the readings have no traceable uncertainty.",
      tag: !meter.certificate ? tag("no certificate", "warn") : left(meter) < 0 ? tag("overdue", "bad") : tag("due soon", "warn"),
    })),
    empty(meters.length ? "All certificates are valid" : "No meters yet", meters.length ? "" : "Register a meter with the readings of a campaign."),
  ),
);

/** The newest campaigns of which nothing has come yet, neither a version nor a measurement, with what they lack. */
async function latestCampaigns() {
  const [works, bodies] = await Promise.all([campaigns, cameras]);
  const newest = works.slice(-AT_MOST - 2).reverse();
  const found = await Promise.all(
    newest.map(async ({ id }) => {
      const [campaign, versions, measured] = await Promise.all([get(`/v1/campaigns/${id}`), get(`/v1/campaigns/${id}/calibrations?limit=1`), get(`/v1/measurements?campaign_id=${id}&limit=1`)]);
      return { campaign, camera: bodies.find((each) => each.id === campaign.camera_id), made: versions.items.length + measured.items.length };
    }),
  );
  return found.filter(({ made }) => !made).slice(0, AT_MOST);
}

function attention(camera, rows) {
  const named = { href: `/cameras/${camera.id}`, title: `${camera.make} ${camera.model} ${camera.serial}` };
  const held = inForce(rows.filter((row) => row.camera_id === camera.id));
  if (!held.length) return [{ ...named, said: "No version is in force.", tag: tag("not calibrated", "warn") }];
  return held
    .filter((each) => (Date.now() - new Date(each.valid_from)) / 1000 > OLD_S || each.flags.length)
    .map((each) => ({
      ...named,
      said: `${labelOf(each.method)} version ${each.version}, in force for ${ago(each.valid_from).replace(" ago", "")}${each.flags.length ? `: ${each.flags.map(words).join(", ")}` : ""}`,
      tag: each.flags.length ? tag("flags", "warn") : tag("old", "warn"),
    }));
}

const left = (meter) => (new Date(meter.certificate.due_on) - Date.now()) / 1000;

function list(items, none) {
  if (!items.length) return none;
  const shown = items.slice(0, AT_MOST).map(({ href, title, said, tag: word }) =>
    h("li", {}, h("div", { class: "todo-head" }, href ? h("a", { href }, title) : h("strong", {}, title), word), said ? h("p", {}, said) : null),
  );
  const more = items.length - shown.length;
  return [h("ul", { class: "todo" }, shown), more > 0 ? h("p", { class: "small muted" }, `and ${more} more`) : null];
}
