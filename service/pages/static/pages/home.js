// The first page: a card to start with, what needs somebody, campaigns in progress, and what is in force.

import { all, get, newOnce, post } from "../api.js";
import { goOn, takeFiles, takeHanded } from "../campaign/drop.js";
import { askForMeter } from "../campaign/target.js";
import { readCard } from "../card/headers.js";
import { propose } from "../card/propose.js";
import { cardView } from "../card/view.js";
import { causeFold, causesOf, jobCause, small, smallLink } from "../causes.js";
import { act, byId, empty, failed, fill, h, load, mark, may, released, table, toast } from "../dom.js";
import { ago, groupBy, number, span, stateWords } from "../format.js";
import { METHODS, headlines, inForce, isNight, kindOf, labelOf, methodOf, titleOf } from "../methods.js";

/** `zone` takes the card, `place` shows it, and `rest` of the page gives way to it. */
function startCard(zone, place, rest) {
  takeFiles(zone, "read", read);
  let reading = null;
  const handed = takeHanded();
  if (handed) read(handed);

  async function read(chosen) {
    if (!chosen.length) return;
    reading?.abort();
    const { signal } = (reading = new AbortController());
    const [count, bar] = [h("strong", { role: "status" }, "Reading the files"), h("progress", { value: 0, max: 1, "aria-label": "Headers read" })];
    show(h("div", { class: "card" }, h("p", { class: "spread" }, count, h("button", { type: "button", class: "small-button", onclick: cancel }, "Stop")), bar));
    const begun = performance.now();
    const onProgress = (done, of) => {
      Object.assign(bar, { value: done, max: of });
      count.textContent = `Reading ${done} of ${of} files`;
    };
    try {
      const [rows, known] = await Promise.all([readCard(chosen, { onProgress, signal }), readKnown()]);
      if (signal.aborted) return;
      const choice = { said: new Map(), leftOut: new Set(), kept: new Set(), cameras: known.cameras };
      await look({ rows, known, choice, answers: new Map(), inForce: known.inForce, seconds: (performance.now() - begun) / 1000, project: { number: "" } });
    } catch (error) {
      if (!signal.aborted) show(failed(error, () => read(chosen)));
    }
  }

  async function look(card) {
    const turn = (card.turn = {});
    const found = await propose(card.rows, { methods: METHODS, ...card.known }, card.choice, card.answers);
    // a late answer never takes the place of a later choice
    if (card.turn !== turn) return;
    card.found = found;
    await released(place);
    if (card.turn !== turn) return;
    const changed = () => (card.looking = look(card).catch((error) => toast(error.message)));
    // what was just changed is not proposed yet
    show(cardView(card, { changed, cancel, send: (button) => act(button, async () => (await card.looking, send(card))) }));
    if (!card.looked) place.querySelector("h1")?.focus();
    card.looked = true;
  }

  function show(...content) {
    rest.hidden = true;
    place.hidden = false;
    fill(place, content);
  }

  function cancel() {
    reading?.abort();
    fill(place).hidden = true;
    rest.hidden = false;
    zone.querySelector("button").focus();
  }
}

async function readKnown() {
  const [cameras, campaigns, series] = await Promise.all([all("/v1/cameras"), all("/v1/campaigns"), get("/v1/series/coefficients")]);
  return { cameras, campaigns, inForce: inForce(series.rows) };
}

/** Create what does not exist yet, then go on to the campaign's page, which sends. */
async function send({ found, choice, project }) {
  const { camera, campaign, frames } = found;
  let id = campaign.campaign?.id;
  if (!id) {
    const { make, model, serial, lens } = camera;
    const cameraId = choice.registered || camera.known?.id || (await post("/v1/cameras", { make, model, serial, lens })).id;
    // a clock without a zone is most likely that of whoever sends
    const [from] = frames.filter((frame) => frame.header.taken).map(({ header: { taken, zoned } }) => taken + (zoned ? 0 : 6e4 * new Date(taken).getTimezoneOffset())).sort((a, b) => a - b);
    const body = { camera_id: cameraId, method: campaign.method, ...(campaign.measures ? { kind: "measurement" } : {}), ...(project.number.trim() ? { project_number: project.number.trim() } : {}), ...(from ? { started_at: new Date(from).toISOString() } : {}) };
    // a second press after a lost answer must not make a second campaign
    id = (await post("/v1/campaigns", body, onceFor(choice, body))).id;
  }
  await goOn(`/campaigns/${id}`, frames.map(({ file, name, role, scene }) => ({ file, name, role, scene })));
}

function onceFor(choice, body) {
  const said = JSON.stringify(body);
  if (choice.sent?.said !== said) choice.sent = { said, once: newOnce() };
  return { once: choice.sent.once };
}

const [OLD_S, SOON_S] = [365 * 86400, 60 * 86400];
const [AT_MOST, MOST_VERSIONS] = [6, 20];
const RANKS = ["bad", "warn", "wait"];

if (byId("card-drop")) startCard(byId("card-drop"), byId("card"), byId("start"));

const cameras = all("/v1/cameras");
const campaigns = all("/v1/campaigns");
const series = get("/v1/series/coefficients");
const latest = latestCampaigns();

load(byId("needs"), () => Promise.all([get("/v1/jobs/causes"), latest, cameras, series, all("/v1/meters"), campaigns]), ([{ items: failures }, works, bodies, { rows }, meters, every]) => {
  const causes = [...failures.map((cause) => jobCause(cause, every)), ...works.flatMap(workCauses), ...meters.flatMap(meterCauses), ...bodies.flatMap((camera) => cameraCauses(camera, rows.filter((row) => row.camera_id === camera.id)))].sort((a, b) => RANKS.indexOf(a.mark) - RANKS.indexOf(b.mark));
  if (!causes.length) return every.length || bodies.length || !byId("card-drop") ? empty("Nothing needs you") : firstSteps();
  // one line a cause: its button leads to the first of several, then to the next
  return causeFold([...groupBy(causes, ({ title }) => title).values()].map((some) => ({ ...some[0], where: some.map(({ where }) => where).join("; ") })));
});

load(byId("campaigns"), () => Promise.all([latest, cameras]), ([works, bodies]) => {
  const begun = works.filter(({ measured, versions }) => !measured && versions.every((version) => version.state === "draft"));
  if (!begun.length) return empty("No campaigns in progress", "A campaign contains the frames and readings of one calibration, or the frames of a measuring night.");
  const camera = (campaign) => bodies.find((each) => each.id === campaign.camera_id);
  const columns = [
    { head: "Campaign", header: true, cell: ({ campaign }) => [h("a", { href: `/campaigns/${campaign.id}` }, titleOf(campaign)), h("span", { class: "sub" }, kindOf(campaign))] },
    { head: "Camera", cell: ({ campaign }) => `${camera(campaign)?.model ?? "–"} ${camera(campaign)?.serial ?? ""}` },
    { head: "Frames", class: "number", cell: ({ campaign: { frames } }) => number(frames.received, 6) },
    { head: "Progress", cell: ({ campaign: { frames }, versions }) => (versions.length ? "Draft fitted" : frames.received ? frames.being_read ? `${frames.received - frames.being_read} of ${frames.received} read` : `${frames.received} read` : "No frames yet") },
    { head: "Missing", cell: ({ campaign }) => lackOf(causesOf(campaign, "error")) },
    { head: "Created", class: "number", cell: ({ campaign }) => h("time", { datetime: campaign.created_at, title: campaign.created_at }, ago(campaign.created_at)) },
  ];
  return table(columns, begun.slice(0, AT_MOST), { caption: "Campaigns in progress", stack: true });
});

load(byId("in-force"), () => Promise.all([cameras, series]), ([bodies, { rows }]) => {
  if (!bodies.length) return empty("No cameras yet", "A camera is registered with its first campaign.");
  const held = inForce(rows);
  const methods = METHODS.filter((method) => held.some((row) => row.method === method.name));
  const of = (camera, method) => held.find((row) => row.camera_id === camera.id && row.method === method.name);
  const oldest = (camera) => held.filter((row) => row.camera_id === camera.id).map((row) => row.valid_from).sort()[0];
  const columns = [
    { head: "Camera", header: true, cell: (camera) => h("a", { href: `/cameras/${camera.id}` }, `${camera.model} ${camera.serial}`) },
    ...methods.map((method) => ({ head: method.label, cell: (camera) => version(of(camera, method)) })),
    { head: "Oldest", class: "number", cell: (camera) => (oldest(camera) ? ago(oldest(camera)).replace(" ago", "") : h("span", { class: "muted" }, "none in force")) },
  ];
  return table(columns, bodies.slice(0, AT_MOST), { caption: "Versions in force, with U (95 %)", stack: true });
});

/** Nothing is there yet: what comes, in place of three empty lists. */
function firstSteps() {
  for (const id of ["campaigns", "in-force"]) byId(id).closest("section").hidden = true;
  return byId("first-steps").content.cloneNode(true);
}

const lackOf = ([first, ...more]) => (first ? `${first.title}${more.length ? ` and ${more.length} more` : ""}` : "Nothing");

const version = (held) => (held ? [mark(held.flags.length ? "warn" : "good"), ` version ${held.version}${held.flags.length ? ", with flags" : ""}`, headlines(held)] : h("span", { class: "muted" }, "none"));

async function latestCampaigns() {
  const newest = (await campaigns).slice(-AT_MOST - 2).reverse();
  return Promise.all(
    newest.map(async ({ id }) => {
      const [campaign, versions, measured] = await Promise.all([get(`/v1/campaigns/${id}`), get(`/v1/campaigns/${id}/calibrations?limit=${MOST_VERSIONS}`), get(`/v1/measurements?campaign_id=${id}&limit=1`)]);
      return { campaign, versions: versions.items, measured: measured.items.length };
    }),
  );
}

function workCauses({ campaign, versions, measured }) {
  const href = `/campaigns/${campaign.id}`;
  const named = titleOf(campaign);
  const mend = (scope, text, part) => [smallLink(may(scope) ? text : "Show campaign", `${href}${part}`)];
  const [draft] = versions.filter((each) => each.state === "draft");
  if (draft) return [{ mark: "wait", title: "A draft waits for publication", where: `${labelOf(campaign.method)}, ${named}, fitted ${ago(draft.created_at)}`, actions: [smallLink("Review", `/calibrations/${draft.id}`)] }];
  if (versions.length || measured) return [];
  const night = isNight(campaign);
  if (!campaign.frames.received) return [{ mark: "wait", title: night ? "A measuring night without frames" : "A campaign without frames", where: named, actions: mend("upload", "Add frames", "#frames") }];
  if (!campaign.missing.length && !campaign.frames.being_read) return [{ mark: "wait", title: night ? "Frames of a night wait to be measured" : "A campaign is ready to fit", where: named, actions: night ? mend("upload", "Measure", "#measure") : mend("calibrate", "Fit", "#calibrate") }];
  return causesOf(campaign, "error").map((cause) => ({ mark: "warn", title: cause.title, where: [named, cause.where].filter(Boolean).join(": "), actions: mend(cause.part === "frames" ? "upload" : "calibrate", cause.button, `#${cause.part}`) }));
}

function meterCauses(meter) {
  const left = meter.certificate ? (new Date(meter.certificate.due_on) - Date.now()) / 1000 : NaN;
  if (left >= SOON_S) return [];
  const name = `${meter.make} ${meter.model} ${meter.serial}`;
  const actions = may("calibrate") ? [small("Add certificate", async () => (await askForMeter(meter)) && location.reload())] : [];
  if (!meter.certificate) return [{ mark: "warn", title: "A meter has no certificate", where: `${name}: its readings have no traceable uncertainty`, actions }];
  return [{ mark: left < 0 ? "bad" : "wait", title: left < 0 ? `Meter certificate expired ${span(-left)} ago` : `Meter certificate expires in ${span(left)}`, where: `${name}, certificate ${meter.certificate.number}, on ${meter.certificate.due_on}`, actions }];
}

/** Of a camera and its coefficients; what a panel calibrates, it calibrates for one flight. */
function cameraCauses(camera, rows) {
  const held = inForce(rows);
  const cause = { mark: "wait", actions: [smallLink("Show camera", `/cameras/${camera.id}`)] };
  const name = `${camera.make} ${camera.model} ${camera.serial}`;
  if (!held.length) return rows.some(({ method }) => methodOf(method).reference === "panel") ? [] : [{ ...cause, title: "A camera is not calibrated", where: `${name}: no version is in force` }];
  return held
    .filter((each) => (Date.now() - new Date(each.valid_from)) / 1000 > OLD_S || each.flags.length)
    .map((each) => ({ ...cause, title: `${labelOf(each.method)} version ${each.version} ${each.flags.length ? "has flags" : `is ${span((Date.now() - new Date(each.valid_from)) / 1000)} old`}`, where: `${name}${each.flags.length ? `: ${each.flags.map(stateWords).join(", ")}` : ""}` }));
}
