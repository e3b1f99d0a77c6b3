// The proposal for a card, of header rows and what the service proposes of method, roles and scenes; docs/pages.md states the limits. No DOM.

import { post } from "../api.js";
import { groupBy, natural } from "../format.js";
import { isNight } from "../methods.js";

export const LIMITS = {
  darkSignal: 0.002, // a centre below this share of the range from black to white is dark
  clipped: 0.01, // share of white pixels in the centre of an overexposed frame
  misplacedRatio: 2, // a frame this many times as bright as its scene
  sameBrightness: 1.3, // may belong to a scene that is as bright within this factor
  recentDays: 3, // campaigns of the camera that are offered
  pause: 6 * 36e5, // frames after so long a pause [ms] are of another day
  apart: 300, // frames this far [m] from those before are of another place
  aside: 20, // a gimbal this far [°] from that of most frames has another aim
};
const CHART = "chart"; // the role whose frames may be pictures
const DAY_MS = 864e5;
const RAW = /\.(dng|tiff?)$/i;
const PICTURE = /\.(jpe?g|png|heic)$/i;
const VIDEO = /\.(mp4|mov|lrv|lrf|srt|thm|m4v)$/i;

export const kindOf = (name) => (RAW.test(name) ? "raw" : PICTURE.test(name) ? "picture" : VIDEO.test(name) ? "video" : "other");
export const plain = (text) => (text ?? "").split(/\s+/).filter(Boolean).join(" ").toLowerCase();
export const nameOf = ({ make, model, serial }) => [model?.startsWith(make) ? null : make, model, serial].filter(Boolean).join(" ") || "Unnamed camera";
/** As the service compares: what a file does not name cannot differ. */
export const differs = (header, camera) => ["serial", "model", "make"].some((name) => plain(header?.[name]) && plain(header[name]) !== plain(camera[name]));

/**
 * rows: [{key, name, size, kind, header, centre}]; context: {methods, cameras, campaigns};
 * choice, what a person has changed: {camera, campaign, said: Map(key -> {role?, scene?}), leftOut: Set(key), kept: Set(check or aside)};
 * answers: what the service has proposed for this card so far.
 */
export async function propose(rows, { methods, cameras = [], campaigns = [] }, choice = {}, answers = new Map()) {
  const { said = new Map(), leftOut = new Set(), kept = new Set() } = choice;
  const raw = rows.filter((row) => row.kind === "raw" && row.header);
  const pictures = raw.length ? [] : rows.filter((row) => row.kind === "picture" && row.header);
  const able = pictures.length ? methods.filter((each) => each.roles.every((role) => role.name === CHART)) : methods;
  const bodies = [...groupBy([...raw, ...pictures], ({ header }) => [header.make, header.model, header.serial].map(plain).join("|")).values()]
    .map((frames) => describeCamera(frames, cameras))
    .sort((a, b) => b.frames.length - a.frames.length);
  const body = bodies.find((each) => each.key === choice.camera) ?? bodies[0] ?? null;
  const asides = body ? findAsides(body.frames, rows) : [];
  const out = new Set(asides.filter((each) => !kept.has(each.key)).flatMap((each) => each.frames));
  const meant = body?.frames.filter((frame) => !out.has(frame)) ?? [];
  const camera = body && { ...body, frames: meant.length ? meant : body.frames };
  const ask = async (more) => {
    const key = JSON.stringify([camera.key, camera.frames.length, [...kept], more]);
    if (!answers.has(key)) answers.set(key, await post("/v1/proposals", { frames: camera.frames.map(stateOf), ...(camera.known ? { camera_id: camera.known.id } : {}), ...more }));
    return answers.get(key);
  };
  if (!camera?.frames.length) return { cameras: bodies, camera: null, skipped: splitSkipped(rows) };
  const offers = listOffers(camera, await ask({}), { methods: able, campaigns });
  const campaign = offers.find((each) => each.key === choice.campaign) ?? offers.find((each) => each.proposed) ?? null;
  const method = campaign && methods.find((each) => each.name === campaign.method);
  const frames = method ? assign(camera.frames, await ask(campaign.asked ? {} : campaign.campaign ? { campaign_id: campaign.campaign.id } : { method: method.name, kind: campaign.measures ? "measurement" : "calibration" }), method, said) : [];
  const here = campaign?.campaign ? frames.filter((frame) => frame.held === campaign.campaign.id) : [];
  const sent = frames.filter((frame) => !leftOut.has(frame.key) && !here.includes(frame));
  const rank = ({ role, scene }) => (scene === undefined ? 1 + (method.roles.findIndex((each) => each.name === role) + 1 || method.roles.length + 1) : 0);
  const scenes = [...groupBy(frames, (frame) => JSON.stringify([frame.role, frame.scene ?? ""])).values()].map(describeScene).sort((a, b) => rank(a) - rank(b) || (a.from ?? 0) - (b.from ?? 0) || natural(a.scene ?? "", b.scene ?? ""));
  const darks = sent.filter((frame) => frame.role === "dark");
  return {
    cameras: bodies,
    camera,
    offers,
    campaign,
    method,
    scenes,
    frames: sent,
    darks,
    here,
    pictures: pictures.length > 0,
    skipped: splitSkipped(rows.filter((row) => !pictures.includes(row))),
    checks: [...asides, ...(method ? listChecks(sent, darks, method, campaign) : [])].filter((check) => !kept.has(check.key)),
  };
}

/** Files that are added to a campaign, each with the role and scene that the service proposes. */
export async function placeIn(campaign, rows) {
  const { frames } = rows.length ? await post("/v1/proposals", { frames: rows.map(stateOf), campaign_id: campaign.id }) : { frames: [] };
  return rows.map((row, at) => ({ ...row, role: frames[at].role, scene: frames[at].scene }));
}

/** A frame as the service is asked about it; an absurd value of its header is left out. */
function stateOf({ name, size, header, centre }) {
  const { taken, exposure_time_s, f_number, iso, band } = header ?? {};
  const positive = (value) => (value > 0 && value < 1e9 ? value : undefined);
  const finite = (value) => (Number.isFinite(value) ? value : undefined);
  return { name: name.slice(-1000), size_bytes: size, taken_s: finite(taken / 1000), exposure_time_s: positive(exposure_time_s), f_number: positive(f_number), iso: positive(iso), band: band?.slice(0, 200), signal_share: finite(centre?.signal) };
}

function describeCamera(frames, cameras) {
  const [{ header: { make, model, serial } }] = frames;
  const lens = frames.find(({ header }) => header.lens.make && header.lens.model)?.header.lens;
  const known = cameras.find((each) => serial && make && model && !differs({ make, model, serial }, each));
  // one body under two names: the campaign of either refuses the other's files
  const renamed = known || !serial ? null : cameras.find((each) => plain(each.serial) === plain(serial));
  return { key: [make, model, serial].map(plain).join("|"), make, model, serial, lens, frames, known, renamed, complete: Boolean(make && model && serial) };
}

function listOffers({ known, frames }, proposal, { methods, campaigns }) {
  const [from] = frames.map((frame) => frame.header.taken).filter(Boolean).sort((a, b) => a - b);
  const holders = [...groupBy(proposal.frames.filter((each) => each.campaign_id), (each) => each.campaign_id)].sort(([, a], [, b]) => b.length - a.length).map(([id]) => id);
  const near = campaigns.filter((each) => methods.some(({ name }) => name === each.method) && each.camera_id === known?.id && !holders.includes(each.id) && Math.abs(Date.parse(each.started_at ?? each.created_at) - (from ?? Date.now())) < LIMITS.recentDays * DAY_MS);
  const { calibration_method: best, measurement_method: night } = proposal;
  const holding = holders.map((id) => campaigns.find((each) => each.id === id)).filter(Boolean);
  const add = (each) => ({ key: each.id, kind: "add", method: each.method, campaign: each, measures: isNight(each), proposed: each === holding[0] });
  return [
    ...holding.slice(0, 2).map(add),
    { key: "new", kind: "new", method: best, proposed: !holding.length && !isNight(proposal), asked: !isNight(proposal) },
    ...near.slice(-2).reverse().map(add),
    ...(night ? [{ key: "night", kind: "night", method: night, measures: true, proposed: !holding.length && isNight(proposal), asked: isNight(proposal) }] : []),
    ...methods.filter((method) => method.name !== best).map((method) => ({ key: `new ${method.name}`, kind: "other", method: method.name })),
  ];
}

/**
 * What lies on the card beside the frames that are meant, and is left out until a person keeps it: of another day or place (runs between
 * long pauses and jumps, of which the longest is meant), of another aim, or cut short. Dark frames go with those nearest in time.
 */
export function findAsides(frames, rows) {
  const ordered = [...frames].sort(byTime);
  const runs = [];
  let before;
  for (const frame of ordered.filter((each) => !isDark(each))) {
    const paused = before && frame.header.taken - before.header.taken > LIMITS.pause;
    const moved = before && distance(frame, before) > LIMITS.apart;
    if (!before || paused || moved) runs.push([]);
    runs.at(-1).push(frame);
    before = moved || frame.header.place || !before ? frame : { ...frame, header: { ...frame.header, place: before.header.place } };
  }
  const away = (frame, run) => Math.min(...run.map((each) => Math.abs(each.header.taken - frame.header.taken)));
  const meant = [...runs].sort((a, b) => b.length - a.length || b[0].header.taken - a[0].header.taken)[0] ?? [];
  if (runs.length > 1) for (const dark of ordered.filter(isDark)) runs.reduce((near, run) => (away(dark, run) < away(dark, near) ? run : near)).push(dark);
  const found = runs.filter((run) => run !== meant).map((run) => {
    const other = Math.min(...run.map((frame) => away(frame, meant))) > LIMITS.pause;
    return { key: `run ${run[0].key}`, code: other ? "other_day" : "other_place", mark: "gap", frames: run, distance_m: distance(run[0], meant[0]) };
  });
  // an aim is one of the place: that of a chart or a flat field changes from frame to frame
  const aimed = meant.filter((frame) => frame.header.aim?.every(Number.isFinite) && !isDark(frame));
  const usual = [0, 1].map((axis) => median(aimed.map((frame) => frame.header.aim[axis])));
  const turned = ({ header: { aim } }) => Math.abs(aim[0] - usual[0]) > LIMITS.aside || (Math.abs(usual[0]) < 60 && Math.abs(((((aim[1] - usual[1]) % 360) + 540) % 360) - 180) > LIMITS.aside);
  const astray = aimed.filter(turned);
  if (astray.length && 3 * astray.length < aimed.length) found.push({ key: `aim ${astray.map((each) => each.key)}`, code: "other_aim", mark: "gap", frames: astray });
  const cut = rows.filter((row) => row.kind === "raw" && (row.fault || (frames.includes(row) && row.header.cut > 0)));
  return [...(cut.length ? [{ key: `cut ${cut.map((each) => each.key)}`, code: "cut", mark: "warn", frames: cut }] : []), ...found];
}

function distance({ header: { place: a } }, { header: { place: b } }) {
  return a && b ? 111e3 * Math.hypot(a[0] - b[0], (a[1] - b[1]) * Math.cos((a[0] * Math.PI) / 180)) : NaN;
}

const isDark = (frame) => frame.centre?.signal < LIMITS.darkSignal;

/** Role and scene of each frame: as a person has said, else as the service proposes. */
function assign(frames, proposal, method, said) {
  const inScenes = new Set(method.roles.filter((role) => role.has_scene).map((role) => role.name));
  return frames
    .map((frame, at) => {
      const proposed = proposal.frames[at];
      const { role = proposed.role, scene = proposed.scene ?? "" } = isNight(proposal) ? proposed : (said.get(frame.key) ?? {});
      return { ...frame, held: proposed.campaign_id, role, scene: inScenes.has(role) ? scene : undefined };
    })
    .sort(byTime);
}

const byTime = (a, b) => (a.header.taken ?? 0) - (b.header.taken ?? 0) || natural(a.name, b.name);
const exposureOf = ({ header: { exposure_time_s: t, iso, f_number: f } }) => (t * (iso ?? 100)) / (f ?? 1) ** 2;

function describeScene(frames) {
  const of = (name) => [...new Set(frames.map((frame) => frame.header[name]).filter(Boolean))].sort((a, b) => a - b);
  const times = of("taken");
  return { role: frames[0].role, scene: frames[0].scene, frames, folder: frames[0].name.split("/").slice(0, -1).join("/"), from: times[0], to: times.at(-1), isos: of("iso"), exposures: of("exposure_time_s"), fNumbers: of("f_number") };
}

export function splitSkipped(rows) {
  const stem = (name) => name.replace(/\.\w+$/, "").toLowerCase();
  const raws = new Set(rows.filter((row) => row.kind === "raw" && row.header).map((row) => stem(row.name)));
  const pictures = rows.filter((row) => row.kind === "picture");
  return {
    twins: pictures.filter((row) => raws.has(stem(row.name))),
    pictures: pictures.filter((row) => !raws.has(stem(row.name))),
    videos: rows.filter((row) => row.kind === "video"),
    others: rows.filter((row) => row.kind === "other" || (row.kind === "raw" && !row.header)),
  };
}

/** What to look at before sending: {key, mark, code, frames?, ...}; the page words it. A series of exposure times is meant to saturate. */
function listChecks(frames, darks, method, campaign) {
  const found = [];
  const lacking = frames.filter(({ header }) => !(header.exposure_time_s && header.f_number && header.iso));
  if (lacking.some((frame) => frame.role !== CHART)) found.push({ key: "exposure", code: "no_exposure", mark: "warn", frames: lacking });
  const white = frames.filter((frame) => frame.role !== "dark" && frame.centre?.clipped > LIMITS.clipped);
  if (white.length && method.grid.rows !== "exposure_time_s") found.push({ key: `clipped ${white.map((frame) => frame.key)}`, code: "overexposed", mark: "warn", frames: white });
  found.push(...findMisplaced(frames, method));
  if (campaign.measures || !method.roles.some((role) => role.name === "dark")) return found;
  const lit = frames.filter((frame) => frame.role !== "dark" && frame.header.exposure_time_s);
  const isos = [...new Set(lit.map((frame) => frame.header.iso))].filter((iso) => iso && !darks.some((dark) => dark.header.iso === iso)).sort((a, b) => a - b);
  if (lit.length && !darks.length) found.push({ key: "no darks", code: "no_darks", mark: "gap" });
  else if (isos.length && lit.length) found.push({ key: "iso darks", code: "darks_lack_iso", mark: "gap", isos });
  const [dark_s, light_s] = [darks, lit].map((some) => Math.max(0, ...some.map((frame) => frame.header.exposure_time_s ?? 0)));
  if (darks.length && light_s > 1.01 * dark_s) found.push({ key: "dark times", code: "darks_too_short", mark: "gap", dark_s, light_s });
  return found;
}

/** Frames far brighter or darker than their scene, per unit of exposure, that fit another one. */
function findMisplaced(frames, method) {
  const role = method.roles.find((each) => each.has_scene)?.name;
  const level = (frame) => frame.centre.signal / exposureOf(frame);
  const measured = frames.filter((frame) => frame.role === role && frame.centre && !isDark(frame) && frame.centre.clipped <= LIMITS.clipped && Number.isFinite(level(frame)));
  const levels = [...groupBy(measured, (frame) => frame.scene)].filter(([, some]) => some.length >= 3).map(([scene, some]) => [scene, median(some.map(level))]);
  const found = [];
  const strange = new Map();
  for (const frame of measured) {
    const own = levels.find(([scene]) => scene === frame.scene)?.[1];
    const ratio = level(frame) / own;
    if (!own || (ratio < LIMITS.misplacedRatio && ratio > 1 / LIMITS.misplacedRatio)) continue;
    const apart = ([, other]) => Math.abs(Math.log(level(frame) / other));
    const [closest] = levels.filter(([scene, other]) => scene !== frame.scene && apart([scene, other]) < Math.log(LIMITS.sameBrightness)).sort((a, b) => apart(a) - apart(b));
    if (closest) found.push({ key: `level ${frame.key}`, code: "misplaced", mark: "warn", frames: [frame], ratio, scene: closest[0] });
    else strange.set(frame.scene, [...(strange.get(frame.scene) ?? []), frame]);
  }
  return [...found, ...[...strange].map(([scene, some]) => ({ key: `levels ${scene} ${some.length}`, code: "uneven", mark: "warn", frames: some }))];
}

function median(values) {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted.length ? (sorted[(sorted.length - 1) >> 1] + sorted[sorted.length >> 1]) / 2 : 0;
}
