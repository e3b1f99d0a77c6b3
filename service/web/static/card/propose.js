// The proposal for a card: header rows in, camera, campaign, scenes, roles, darks and what is skipped out. No DOM.

import { groupBy, natural } from "../groups.js";
import { isNight } from "../methods.js";

/** Thresholds, as docs/pages.md states them. */
export const LIMITS = {
  pause_s: 60, // a pause this long starts a scene,
  pauses: 2.5, // if it is also this many times the median pause
  exposureRatio: 4, // a change of t * ISO / f^2 by this factor starts one after two median pauses
  darkSignal: 0.002, // a centre below this share of the range from black to white is dark
  clipped: 0.01, // share of white pixels in the centre of an overexposed frame
  misplacedRatio: 2, // a frame this many times as bright as its scene
  sameBrightness: 1.3, // may belong to a scene that is as bright within this factor
  recentDays: 3, // campaigns of the camera that are offered
};
export const FIELD = "field";
const CHART = "chart"; // the role whose frames may be pictures
const DAY_MS = 864e5;
const RAW = /\.(dng|tiff?)$/i;
const PICTURE = /\.(jpe?g|png|heic)$/i;
const VIDEO = /\.(mp4|mov|lrv|lrf|srt|thm|m4v)$/i;
// folders that cameras make (DCF: three digits and five characters), which name no scene
const CAMERA_FOLDER = /^(dcim|\d{3}\w{5}|\d{4}set|\d{3}|dji_\d+_.*)$/i;

export const kindOf = (name) => (RAW.test(name) ? "raw" : PICTURE.test(name) ? "picture" : VIDEO.test(name) ? "video" : "other");
export const plain = (text) => (text ?? "").split(/\s+/).filter(Boolean).join(" ").toLowerCase();
export const nameOf = ({ make, model, serial }) => [model?.startsWith(make) ? null : make, model, serial].filter(Boolean).join(" ") || "Unnamed camera";
/** As the service compares: what a file does not name cannot differ. */
export const differs = (header, camera) => ["serial", "model", "make"].some((name) => plain(header?.[name]) && plain(header[name]) !== plain(camera[name]));

/**
 * rows: [{key, name, size, kind, header, centre}]; context: {methods, cameras, campaigns, inForce: [{camera_id, method}]};
 * choice, what a person has changed: {camera, campaign, said: Map(key -> {role?, scene?}), leftOut: Set(key), kept: Set(check)}.
 */
export function propose(rows, { methods, cameras = [], campaigns = [], inForce = [] }, choice = {}) {
  const { said = new Map(), leftOut = new Set(), kept = new Set() } = choice;
  const raw = rows.filter((row) => row.kind === "raw" && row.header);
  const pictures = raw.length ? [] : rows.filter((row) => row.kind === "picture" && row.header);
  const able = pictures.length ? methods.filter((each) => each.roles.every((role) => role.name === CHART)) : methods;
  const bodies = [...groupBy([...raw, ...pictures], ({ header }) => [header.make, header.model, header.serial].map(plain).join("|")).values()]
    .map((frames) => describeCamera(frames, cameras))
    .sort((a, b) => b.frames.length - a.frames.length);
  const camera = bodies.find((each) => each.key === choice.camera) ?? bodies[0] ?? null;
  const own = camera?.frames ?? [];
  const offers = camera ? listOffers(own, camera, { methods: able, campaigns, inForce }) : [];
  const campaign = offers.find((each) => each.key === choice.campaign) ?? offers.find((each) => each.proposed) ?? null;
  const method = campaign && methods.find((each) => each.name === campaign.method);
  const frames = method ? assign(own, method, campaign, said) : [];
  const sent = frames.filter((frame) => !leftOut.has(frame.key));
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
    pictures: pictures.length > 0,
    skipped: splitSkipped(rows.filter((row) => !pictures.includes(row))),
    checks: method ? listChecks(sent, darks, method, campaign).filter((check) => !kept.has(check.key)) : [],
  };
}

function describeCamera(frames, cameras) {
  const [{ header: { make, model, serial } }] = frames;
  const lens = frames.find(({ header }) => header.lens.make && header.lens.model)?.header.lens;
  const known = cameras.find((each) => serial && make && model && !differs({ make, model, serial }, each));
  // one body under two names: the campaign of either refuses the other's files
  const renamed = known || !serial ? null : cameras.find((each) => plain(each.serial) === plain(serial));
  return { key: [make, model, serial].map(plain).join("|"), make, model, serial, lens, frames, known, renamed, complete: Boolean(make && model && serial) };
}

function listOffers(frames, camera, { methods, campaigns, inForce }) {
  const words = [...new Set(methods.flatMap(roleWords))];
  const named = frames.map((frame) => namedRole(frame.name, words)).filter(Boolean);
  const bands = new Set(frames.map((frame) => frame.header.band).filter(Boolean)).size;
  const score = (method) => {
    const own = new Set(method.roles.filter((role) => role.used_in_fit).map((role) => role.name));
    const told = named.filter((role) => role !== FIELD).reduce((sum, role) => sum + (own.has(role) ? 1 : -1), 0);
    return told + (bands > 1 ? (method.reference === "panel" ? frames.length : -frames.length) : 0);
  };
  const [best] = [...methods].sort((a, b) => score(b) - score(a));
  const held = new Set(camera.known ? inForce.filter((row) => row.camera_id === camera.known.id).map((row) => row.method) : []);
  const measuring = methods.filter((method) => method.measured_quantity);
  const night = measuring.find((method) => held.has(method.name)) ?? measuring.find((method) => (method.reference === "panel") === bands > 1) ?? measuring[0];
  const looksLikeNight = named.length > 0 ? named.every((role) => role === FIELD) : held.has(night?.name) && !foldersOf(frames).length && !frames.some(isDark);
  const [from] = frames.map((frame) => frame.header.taken).filter(Boolean).sort((a, b) => a - b);
  const near = campaigns.filter((each) => methods.some(({ name }) => name === each.method) && each.camera_id === camera.known?.id && Math.abs(Date.parse(each.started_at ?? each.created_at) - (from ?? Date.now())) < LIMITS.recentDays * DAY_MS);
  return [
    { key: "new", kind: "new", method: best.name, proposed: !looksLikeNight },
    ...near.slice(-2).reverse().map((each) => ({ key: each.id, kind: "add", method: each.method, campaign: each, measures: isNight(each) })),
    ...(night ? [{ key: "night", kind: "night", method: night.name, measures: true, proposed: looksLikeNight }] : []),
    ...methods.filter((method) => method !== best).map((method) => ({ key: `new ${method.name}`, kind: "other", method: method.name })),
  ];
}

/** The role that a folder's name begins with, or that a file's name contains; of field frames, a folder alone. */
function namedRole(path, words) {
  const folders = path.toLowerCase().split("/");
  const file = folders.pop();
  return [...words, FIELD].find((role) => folders.some((folder) => folder.startsWith(role)) || (role !== FIELD && file.includes(role)));
}
const roleWords = (method) => method.roles.filter((role) => role.used_in_fit && !role.has_scene).map((role) => role.name);
const isDark = (frame) => frame.centre !== undefined && frame.centre.signal < LIMITS.darkSignal;
const folderOf = (path) => path.split("/").slice(0, -1).reverse().find((part) => !CAMERA_FOLDER.test(part)) ?? "";
/** The folders that name scenes: more than one, as one alone is the card's or the night's. */
function foldersOf(frames) {
  const found = [...new Set(frames.map((frame) => folderOf(frame.name)).filter(Boolean))];
  return found.length > 1 ? found : [];
}

/** Role and scene of each frame. */
function assign(frames, method, campaign, said) {
  const sceneRole = method.roles.find((role) => role.has_scene);
  const roles = new Map(method.roles.map((role) => [role.name, role]));
  const found = frames.map((frame) => {
    const role = campaign.measures ? FIELD : (namedRole(frame.name, roleWords(method)) ?? (roles.has("dark") && isDark(frame) ? "dark" : (sceneRole ?? method.roles[0]).name));
    return { ...frame, role: campaign.measures ? FIELD : (said.get(frame.key)?.role ?? role) };
  });
  const inScenes = found.filter((frame) => roles.get(frame.role)?.has_scene);
  const folders = new Set(foldersOf(inScenes));
  const open = inScenes.filter((frame) => !folders.has(folderOf(frame.name))).sort(byTime);
  const byPause = new Map();
  splitScenes(open).forEach((some, index) => some.forEach((frame) => byPause.set(frame.key, `Scene ${index + 1}`)));
  return found
    .map((frame) => ({ ...frame, scene: roles.get(frame.role)?.has_scene ? (said.get(frame.key)?.scene ?? byPause.get(frame.key) ?? folderOf(frame.name)) : undefined, origin: byPause.has(frame.key) ? "pause" : "folder" }))
    .sort(byTime);
}

/** Frames in the order of their time, split at long pauses and at changes of the exposure. */
export function splitScenes(frames) {
  const gaps = frames.slice(1).map((frame, index) => ((frame.header.taken ?? 0) - (frames[index].header.taken ?? 0)) / 1000);
  const usual = median(gaps) || 0;
  const scenes = frames.length ? [[frames[0]]] : [];
  frames.slice(1).forEach((frame, index) => {
    const ratio = exposureOf(frame) / exposureOf(frames[index]);
    const changed = ratio > LIMITS.exposureRatio || ratio < 1 / LIMITS.exposureRatio;
    if (gaps[index] >= Math.max(LIMITS.pause_s, LIMITS.pauses * usual) || (changed && usual > 0 && gaps[index] >= 2 * usual)) scenes.push([]);
    scenes.at(-1).push(frame);
  });
  return scenes;
}

const byTime = (a, b) => (a.header.taken ?? 0) - (b.header.taken ?? 0) || natural(a.name, b.name);
const exposureOf = ({ header: { exposure_time_s: t, iso, f_number: f } }) => (t * (iso ?? 100)) / (f ?? 1) ** 2;

function describeScene(frames) {
  const of = (name) => [...new Set(frames.map((frame) => frame.header[name]).filter(Boolean))].sort((a, b) => a - b);
  const times = of("taken");
  return { role: frames[0].role, scene: frames[0].scene, frames, folder: frames[0].name.split("/").slice(0, -1).join("/"), from: times[0], to: times.at(-1), isos: of("iso"), exposures: of("exposure_time_s"), fNumbers: of("f_number") };
}

/** JPEG twins of raw frames, other pictures, videos, and other files. */
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

/** What to look at before sending: {key, mark, code, frames?, ...}; the page words it. */
function listChecks(frames, darks, method, campaign) {
  const found = [];
  const lacking = frames.filter(({ header }) => !(header.exposure_time_s && header.f_number && header.iso));
  if (lacking.length && lacking.some((frame) => frame.role !== CHART)) found.push({ key: "exposure", code: "no_exposure", mark: "warn", frames: lacking });
  const white = frames.filter((frame) => frame.role !== "dark" && frame.centre?.clipped > LIMITS.clipped);
  if (white.length) found.push({ key: `clipped ${white.map((frame) => frame.key)}`, code: "overexposed", mark: "warn", frames: white });
  found.push(...findMisplaced(frames, method));
  if (campaign.measures || !method.roles.some((role) => role.name === "dark")) return found;
  const lit = frames.filter((frame) => frame.role !== "dark" && frame.header.exposure_time_s);
  const isos = [...new Set(lit.map((frame) => frame.header.iso))].filter((iso) => iso && !darks.some((dark) => dark.header.iso === iso)).sort((a, b) => a - b);
  if (lit.length && !darks.length) found.push({ key: "no darks", code: "no_darks", mark: "gap" });
  else if (isos.length && lit.length) found.push({ key: "iso darks", code: "darks_lack_iso", mark: "gap", isos });
  const longest = (some) => Math.max(...some.map((frame) => frame.header.exposure_time_s ?? 0));
  if (darks.length && lit.length && longest(lit) > 1.01 * longest(darks)) found.push({ key: "dark times", code: "darks_too_short", mark: "gap", dark_s: longest(darks), light_s: longest(lit) });
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
