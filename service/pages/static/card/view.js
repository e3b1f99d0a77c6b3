// What a card holds and what is proposed for it, with everything that can be changed before sending.

import { about, field, select } from "../ask.js";
import { causeList, small } from "../causes.js";
import { figure, fill, h, mark, openDialog, table } from "../dom.js";
import { bytes, counted, exposureTime, number, percent, span, tag } from "../format.js";
import { kindOf, labelOf, roleLabel, roleOptions, titleOf } from "../methods.js";
import { registerCamera } from "../pages/camera-edit.js";
import { timeline } from "../timeline.js";
import { readRow } from "./headers.js";
import { LIMITS, nameOf } from "./propose.js";

const [WIDTH, HEIGHT] = [128, 96];
const drawn = new Map();

/** A canvas; a frame without both stays black. Each is drawn once. */
function drawPicture(frame) {
  let canvas = drawn.get(frame.key);
  if (!canvas) {
    canvas = h("canvas", { class: "picture", width: WIDTH, height: HEIGHT, "aria-hidden": "true" });
    drawn.set(frame.key, canvas);
    // a file that cannot be drawn stays black: it is a hint, and what is wrong with it is said elsewhere
    draw(canvas, frame).catch(() => {});
  }
  return canvas;
}

async function draw(canvas, { file, header }) {
  const context = canvas.getContext("2d");
  if (header.preview) {
    const picture = await createImageBitmap(new Blob([await file.slice(header.preview.at, header.preview.at + header.preview.size).arrayBuffer()], { type: "image/jpeg" }), { resizeWidth: WIDTH, resizeHeight: HEIGHT });
    context.drawImage(picture, 0, 0);
    return;
  }
  if (!header.image) return;
  const { width, height, black, white } = header.image;
  const pixels = context.createImageData(WIDTH, HEIGHT);
  for (let y = 0; y < HEIGHT; y += 1) {
    // even rows and columns: one colour of a mosaic
    const row = await readRow(file, header.image, 2 * Math.floor(((y + 0.5) / HEIGHT) * (height / 2)));
    for (let x = 0; x < WIDTH; x += 1) {
      const share = (row[2 * Math.floor(((x + 0.5) / WIDTH) * (width / 2))] - black) / (white - black);
      pixels.data.set([1, 1, 1].map(() => 255 * Math.max(0, share) ** (1 / 2.2)).concat(255), 4 * (y * WIDTH + x));
    }
  }
  context.putImageData(pixels, 0, 0);
}

const LINK_MBIT = 20;

/** `card`: {rows, choice, seconds, project, found: the proposal}; `tell`: {changed(), send(), cancel()}. */
export function cardView(card, tell) {
  const { found } = card;
  if (!found.camera) return nothingRaw(card, tell);
  return [
    head(card),
    figures(found),
    h("div", { class: "side" }, h("div", {}, cameraTrouble(card, tell), checks(card, tell), scenes(card, tell)), h("aside", { class: "stack-gap", "aria-label": "Proposal" }, cameraCard(card), campaignCard(card, tell), afterwards(found))),
    foot(card, tell),
  ];
}

const list = (items) => items.filter(Boolean).join(", ");
const shortName = (path) => path.split("/").at(-1).replace(/\.\w+$/, "");
const scenesOf = (found) => found.scenes.filter((each) => each.scene !== undefined);
const names = (frames) => `${frames.slice(0, 5).map((frame) => shortName(frame.name)).join(", ")}${frames.length > 5 ? ` and ${frames.length - 5} more` : ""}`;
const isosOf = (frames) => [...new Set(frames.map((frame) => frame.header.iso).filter(Boolean))].sort((a, b) => a - b);
export const isoValues = (frames) => { const { length } = isosOf(frames); return length ? counted(length, "ISO value") : ""; };
const stamp = (instant, from = 0, to = 16) => new Date(instant).toISOString().replace("T", " ").slice(from, to);
/** "2026-05-01 21:10–21:14": a date once, if it is one. */
const period = (from, to) => (stamp(from) === stamp(to) ? stamp(from) : `${stamp(from)}–${stamp(to, stamp(from, 0, 10) === stamp(to, 0, 10) ? 11 : 0)}`);
const taken = (frames) => { const times = frames.map((frame) => frame.header?.taken).filter(Boolean); return times.length ? period(Math.min(...times), Math.max(...times)) : "no time"; };
const between = (from, to, say) => (from === to ? say(from) : `${say(from)} to ${say(to)}`);

function head({ found, rows, seconds }) {
  const inScenes = scenesOf(found).length;
  const title = list([counted(found.frames.length, "frame"), inScenes && counted(inScenes, "scene"), found.cameras.length > 1 ? `${found.cameras.length} cameras` : `one ${found.camera.known ? "known" : "new"} camera`]);
  const there = found.here.length && !found.frames.length && `${counted(found.here.length, "frame")}, already here`;
  return h("div", { class: "head" },
    h("nav", { class: "crumbs", "aria-label": "Breadcrumbs" }, h("a", { href: "/" }, "Start")),
    h("div", { class: "head-row" }, h("h1", { tabindex: "-1" }, there || title)),
    h("p", { class: "under" }, h("span", {}, `${counted(rows.length, "file")} read in ${number(seconds, 2)} s`), h("span", {}, found.here.length ? `Already here: ${found.here.length} of ${found.here.length + found.frames.length}` : "No frame has been sent")),
  );
}

function figures(found) {
  const darks = found.frames.filter((frame) => frame.role === "dark");
  const lit = found.frames.filter((frame) => frame.role !== "dark");
  const role = [...new Set(lit.map((frame) => frame.role))];
  const size = found.frames.reduce((sum, frame) => sum + frame.size, 0);
  const { twins, pictures, videos, others } = found.skipped;
  const skipped = [...twins, ...pictures, ...videos, ...others];
  const kinds = new Set(found.frames.map((frame) => frame.name.split(".").at(-1).toUpperCase()));
  return h("dl", { class: "figures" },
    figure(found.pictures ? "Pictures" : "Raw frames", number(found.frames.length, 6), list([bytes(size), kinds.size === 1 && `all ${[...kinds][0]}`])),
    figure(role.length === 1 ? `${roleLabel(role[0])} frames` : "Other frames", number(lit.length, 6), list([scenesOf(found).length && counted(scenesOf(found).length, "scene"), isoValues(lit)])),
    figure("Dark frames", number(darks.length, 6), darks.length ? list([isoValues(darks), exposuresOf(darks)]) : "none found"),
    figure("Skipped", number(skipped.length, 6), skipped.length ? [list([twins.length && counted(twins.length, "JPEG twin"), pictures.length && counted(pictures.length, "picture"), videos.length && counted(videos.length, "video"), others.length && counted(others.length, "other")]), skippedList(skipped)] : "nothing"),
  );
}

const skippedList = (rows) => h("details", {}, h("summary", {}, "list"), h("ul", { class: "plain" }, rows.slice(0, 500).map((row) => h("li", {}, row.name, row.fault ? `: ${row.fault}` : ""))));

function exposuresOf(frames) {
  const times = frames.map((frame) => frame.header.exposure_time_s).filter(Boolean).sort((a, b) => a - b);
  return times.length ? between(times[0], times.at(-1), exposureTime) : "";
}

function nothingRaw({ rows, found }, tell) {
  const { pictures, videos, others } = found.skipped;
  const held = list([pictures.length && counted(pictures.length, "picture"), videos.length && counted(videos.length, "video"), others.length && counted(others.length, "other file")]);
  const fault = rows.find((row) => row.fault)?.fault;
  const advice = pictures.length ? "JPEG has lost the sensor values: set the camera to RAW or JPEG + RAW. Pictures of a test chart can be sent: start without files." : "DNG and TIFF files can be read.";
  return [h("div", { class: "failed", role: "alert" }, h("p", { class: "failed-title" }, "No raw frames here"), h("p", {}, `The folder holds ${held || "no files"}. ${fault ? `${fault} ` : ""}${advice}`), h("p", { class: "actions" }, h("button", { type: "button", onclick: tell.cancel }, "Choose another folder"), h("a", { class: "button quiet", href: "/campaigns/new" }, "Start without files")))];
}

/** Two cameras on the card, a camera known under another name, or one that the campaign is not for. */
function cameraTrouble({ found, choice }, tell) {
  const { cameras, camera, campaign } = found;
  const box = (kind, title, text, ...actions) => h("div", { class: `verdict-words ${kind}`, role: "alert" }, mark(kind), h("h2", {}, title), h("p", {}, text), actions.length ? h("p", { class: "actions" }, actions) : null);
  const several = cameras.length > 1 && box("warn",
    `${["Two", "Three", "Four", "Five"][cameras.length - 2] ?? cameras.length} cameras on this card`,
    `${list(cameras.map((each) => `${counted(each.frames.length, "frame")} of ${nameOf(each)}`))}. A campaign has one camera: its frames are sent now, the others with the next.`,
    ...cameras.map((each) => small(`Send only ${each.serial ?? each.model ?? "the unnamed"}`, () => ((choice.camera = each.key), tell.changed()), { "aria-pressed": String(each === camera), "data-keep": each.key })),
  );
  const renamed = camera.renamed && box("bad",
    "This serial number belongs to a camera of another name",
    `Registered is ${nameOf(camera.renamed)}. ${camera.frames.length === 1 ? "The file says" : `All ${camera.frames.length} files say`} ${nameOf(camera)}. The campaigns of ${nameOf(camera.renamed)} refuse these files; a new campaign registers the name that the files state. Nothing has been sent.`,
  );
  const incomplete = !camera.complete && box("bad", "These files do not name their camera", `They state ${nameOf(camera)}. Make, model and serial number are needed: choose the camera of these frames, or register it.`, campaign ? cameraChooser(found, choice, tell) : null);
  const lossy = found.pictures && box("warn", "These are JPEG pictures", "They have lost the sensor values: the sharpness and the geometry of a lens can be found in pictures of a chart, light cannot. To measure light, set the camera to RAW or JPEG + RAW.");
  return [lossy, several, renamed, incomplete].filter(Boolean);
}

function cameraChooser({ camera }, choice, tell) {
  const chosen = (event) => ((choice.registered = event.target.value), tell.changed());
  const known = (choice.cameras ?? []).filter((each) => !camera.serial || !each.serial || each.serial === camera.serial);
  const register = async () => {
    const made = await registerCamera(camera);
    if (!made) return;
    choice.cameras = [...(choice.cameras ?? []), made];
    choice.registered = made.id;
    tell.changed();
  };
  return [select([["", "Choose the camera…"], ...known.map((each) => [each.id, nameOf(each)])], { "aria-label": "Camera of these frames", "data-keep": "registered", onchange: chosen }, choice.registered), small("Register a camera…", register, { "data-keep": "register" })];
}

const SAID = {
  other_day: ({ frames }) => [`${counted(frames.length, "frame")} of another day`, `${taken(frames)}. Left out.`],
  other_place: ({ frames, distance_m }) => [`${counted(frames.length, "frame")} of another place`, `${taken(frames)}, ${distance_m > 0 ? `${number(distance_m, 2)} m away` : "elsewhere"}. Left out.`],
  other_aim: ({ frames }) => [`${counted(frames.length, "frame")} with another aim`, `${taken(frames)}; the gimbal pointed more than ${LIMITS.aside}° away: ${names(frames)}. Left out.`],
  cut: ({ frames }) => [frames.length === 1 ? `${shortName(frames[0].name)} is cut short` : `${frames.length} files are cut short`, `${frames[0].header ? `It lacks ${bytes(frames[0].header.cut)} that its own tables name` : frames[0].fault.replace(/\.$/, "")}${frames.length > 1 ? `; also ${names(frames.slice(1))}` : ""}. Left out: copy it from the card again.`],
  overexposed: ({ frames }) =>
    frames.length === 1
      ? [`${shortName(frames[0].name)} is overexposed`, `${percent(frames[0].centre.clipped)} of its centre is white (${list([frames[0].scene, frames[0].header.iso && `ISO ${frames[0].header.iso}`, exposureTime(frames[0].header.exposure_time_s)])}).`]
      : [`${frames.length} frames are overexposed`, `More than ${percent(LIMITS.clipped, 3)} of the centre is white: ${names(frames)}.`],
  misplaced: ({ frames: [frame], ratio, scene }) => [`${shortName(frame.name)} may belong to ${scene}`, `It is ${number(ratio > 1 ? ratio : 1 / ratio, 2)} times as ${ratio > 1 ? "bright" : "dark"} as the rest of ${frame.scene}, at equal exposure.`],
  uneven: ({ frames }) => [`${counted(frames.length, "frame")} of ${frames[0].scene} ${frames.length === 1 ? "differs" : "differ"} in brightness`, `At equal exposure, by more than a factor of ${LIMITS.misplacedRatio} from the rest: ${names(frames)}.`],
  no_exposure: ({ frames }) => [`${counted(frames.length, "frame")} without exposure`, `Exposure time, f-number or ISO is missing in ${shortName(frames[0].name)}${frames.length > 1 ? " and others" : ""}; it can be entered after sending.`],
  no_darks: () => ["No dark frames", "Take some with the lens cap on, at the exposure times and ISO values of the other frames, and add them later."],
  darks_lack_iso: ({ isos }) => [`No dark frames at ISO ${isos.join(", ")}`, "Take one or more per ISO value with the lens cap on, and add them later."],
  darks_too_short: ({ dark_s: dark, light_s: light }) => [`Dark frames up to ${exposureTime(dark)} only`, `The other frames run to ${exposureTime(light)}. One more dark frame per ISO value at ${exposureTime(light)} would cover them.`],
};

export const sayCheck = (check) => SAID[check.code](check);

function checks({ found, choice }, tell) {
  if (!found.checks.length) return null;
  const keep = (check) => small(["overexposed", "cut"].includes(check.code) ? "Send anyway" : "Keep", () => (choice.kept.add(check.key), tell.changed()), { quiet: true });
  const include = (check) => small("Include", () => (choice.kept.add(check.key), tell.changed()));
  const asides = ["other_day", "other_place", "other_aim"];
  const mend = {
    overexposed: (check) => small("Leave out", () => (check.frames.forEach((frame) => choice.leftOut.add(frame.key)), tell.changed())),
    misplaced: (check) => small(`Move to ${check.scene}`, () => (move(choice, check.frames, { scene: check.scene }), tell.changed())),
  };
  const lines = found.checks.map((check) => {
    const [title, where] = sayCheck(check);
    return { mark: check.mark, title, where, actions: asides.includes(check.code) ? [include(check)] : [mend[check.code]?.(check), check.code === "cut" && !check.frames.some((frame) => frame.header) ? null : keep(check)].filter(Boolean) };
  });
  return h("section", { class: "tight", "aria-labelledby": "check" }, h("div", { class: "section-head" }, h("h2", { id: "check" }, "Check before sending"), h("p", {}, "You can send now and fix these later")), causeList(lines));
}

function move(choice, frames, said) {
  for (const frame of frames) choice.said.set(frame.key, { ...choice.said.get(frame.key), ...said });
}

function scenes(card, tell) {
  const { found, choice } = card;
  const checked = new Set(found.checks.filter((check) => check.mark === "warn").flatMap((check) => check.frames ?? []).map((frame) => frame.key));
  return h("section", { class: "tight", "aria-labelledby": "scenes" },
    h("div", { class: "section-head" }, h("h2", { id: "scenes" }, "Scenes"), h("p", {}, "From folders, pauses and exposure. Drag the edge of a bracket to split or join, or give two scenes one name.")),
    timeline(found, { checked, regroup: (frames, scene) => (move(choice, frames, { scene: scene ?? freshName(found) }), tell.changed()) }),
    table(sceneColumns(card, checked, tell), found.scenes, { caption: "Scenes", stack: true, kind: "scenes" }),
  );
}

function sceneColumns({ found, choice }, checked, tell) {
  const change = (frames, said) => (move(choice, frames, said), tell.changed());
  const place = (scene) => found.scenes.indexOf(scene) + 1;
  const roles = roleOptions(found.method).filter(([each]) => each === "field" || (!found.campaign.measures && found.method.roles.some((own) => own.name === each)));
  const name = (scene) => h("input", { value: scene.scene, "aria-label": `Name of scene ${place(scene)}`, "data-keep": `scene ${place(scene)}`, onchange: ({ target }) => change(scene.frames, { scene: target.value.trim() || scene.scene }) });
  const role = (scene) => select(roles, { "aria-label": `Role of scene ${place(scene)}`, "data-keep": `role ${place(scene)}`, onchange: ({ target }) => change(scene.frames, { role: target.value }) }, scene.role);
  const count = (scene) => {
    const { frames } = scene;
    const outs = frames.filter((frame) => choice.leftOut.has(frame.key)).length;
    const show = h("button", { type: "button", class: "link", "aria-label": `${counted(frames.length, "frame")} of scene ${place(scene)}: show`, onclick: () => showFrames(found, scene, choice, tell) }, String(frames.length - outs));
    return [show, outs ? ` of ${frames.length}` : "", frames.some((frame) => checked.has(frame.key)) ? [" ", mark("warn", "A frame to check")] : null];
  };
  const figureOf = (text) => [h("span", { class: "num small" }, text || "–")];
  return [
    { head: h("span", { class: "hidden" }, "Picture"), class: "pic", cell: ({ frames }) => drawPicture(frames.find((frame) => !choice.leftOut.has(frame.key)) ?? frames[0]) },
    { head: "Scene", cell: (scene) => [scene.scene === undefined ? roleLabel(scene.role) : name(scene)] },
    { head: "Taken", cell: (scene) => [h("span", { class: "num" }, scene.from ? period(scene.from, scene.to) : "–"), h("span", { class: "sub" }, scene.folder ? `${scene.folder}/` : "")] },
    { head: "Frames", class: "number", cell: count },
    { head: "ISO", cell: (scene) => figureOf(scene.isos.join(", ")) },
    { head: "Exposure", cell: ({ exposures: times }) => figureOf(times.length && between(times[0], times.at(-1), exposureTime)) },
    { head: "Role", cell: (scene) => [role(scene)] },
  ];
}

function freshName(found) {
  const names = scenesOf(found).map((each) => each.scene);
  for (let count = names.length + 1; ; count += 1) if (!names.includes(`Scene ${count}`)) return `Scene ${count}`;
}

function showFrames(found, scene, choice, tell) {
  const names = scenesOf(found).map((each) => each.scene);
  const fresh = freshName(found);
  const body = h("div");
  const dialog = h("dialog", { class: "frame-dialog", "aria-label": "Frames of the scene", onclose: tell.changed }, h("div", { class: "section-head" }, h("h2", {}, `${scene.scene ?? roleLabel(scene.role)}: ${counted(scene.frames.length, "frame")}`), h("button", { type: "button", class: "quiet", onclick: () => dialog.close() }, "Close")), body);
  const sceneOf = (frame) => choice.said.get(frame.key)?.scene ?? frame.scene;
  const columns = [
    { head: "Frame", header: true, cell: (frame) => shortName(frame.name) },
    { head: "Taken", class: "num", cell: ({ header: { taken } }) => (taken ? stamp(taken, 0, 19) : "–") },
    { head: "Exposure", class: "num", cell: ({ header }) => list([exposureTime(header.exposure_time_s), header.f_number && `f/${number(header.f_number, 3)}`, header.iso && `ISO ${header.iso}`]) },
    { head: "Scene", cell: (frame) => (scene.scene === undefined ? "–" : select([...new Set([...names, fresh])].map((name) => [name, name]), { "aria-label": `Scene of ${shortName(frame.name)}`, onchange: (event) => move(choice, [frame], { scene: event.target.value }) }, sceneOf(frame))) },
    { head: "Send", cell: ({ key, name }) => h("input", { type: "checkbox", checked: !choice.leftOut.has(key), "aria-label": `Send ${shortName(name)}`, onchange: (event) => (event.target.checked ? choice.leftOut.delete(key) : choice.leftOut.add(key)) }) },
    { head: h("span", { class: "hidden" }, "Split"), cell: (frame) => (scene.scene !== undefined && frame !== scene.frames[0] ? small("Split here", () => split(frame), { quiet: true, "aria-label": `Split here: ${shortName(frame.name)} starts ${fresh}` }) : null) },
  ];
  const draw = () => fill(body, table(columns, scene.frames, { caption: "Frames of the scene" }));
  const split = (frame) => (move(choice, scene.frames.slice(scene.frames.indexOf(frame)), { scene: fresh }), draw());
  draw();
  openDialog(dialog);
}

function cameraCard({ found: { camera, cameras }, inForce }) {
  const held = (inForce ?? []).filter((row) => row.camera_id === camera.known?.id).map((row) => `${labelOf(row.method)} version ${row.version}`);
  return h("div", { class: "card" },
    h("p", { class: "panel-title" }, "Camera"),
    h("p", { class: "spread" }, h("strong", {}, nameOf(camera)), camera.known ? tag("known", "good") : tag("new", "live")),
    h("p", { class: "small muted" }, cameras.length === 1 && camera.frames.length > 1 ? `All ${camera.frames.length} headers agree. ` : "", camera.known ? (held.length ? `In force: ${held.join(", ")}.` : "No version is in force.") : "It is registered with the campaign."),
  );
}

function campaignCard({ found, choice, project }, tell) {
  const { offers, campaign } = found;
  const text = {
    new: () => [`New ${labelOf(campaignOf("new").method).toLowerCase()} calibration`, list([scenesOf(found).length && counted(scenesOf(found).length, "scene"), isoValues(found.frames), found.darks.length && "dark frames"])],
    add: (offer) => [`Add to ${titleOf(offer.campaign)}`, [kindOf(offer.campaign), offer.proposed && found.here.length ? `already here: ${found.here.length} of ${found.here.length + found.frames.length}` : `same camera, within ${LIMITS.recentDays} days`].join(", ")],
    night: (offer) => ["Measuring night", `Field frames for ${labelOf(offer.method).toLowerCase()}; never used to calibrate`],
  };
  const campaignOf = (key) => offers.find((offer) => offer.key === key);
  const pick = (key) => ((choice.campaign = key), tell.changed());
  const others = offers.filter((offer) => offer.kind === "other");
  const pickers = offers.filter((offer) => offer.kind !== "other").map((offer) => {
    const [title, sub] = text[offer.kind](offer);
    return picker(title, sub, offer === campaign, offer.key, () => pick(offer.key));
  });
  return h("fieldset", { class: "card" },
    h("legend", { class: "hidden" }, "Campaign"),
    h("p", { class: "panel-title", "aria-hidden": "true" }, "Campaign"),
    h("div", { class: "pickers" }, pickers, picker("Something else", list(others.map((offer) => labelOf(offer.method))), campaign.kind === "other", "other", () => pick(others[0].key))),
    campaign.kind === "other" ? field("Method", select(others.map((offer) => [offer.key, labelOf(offer.method)]), { "data-keep": "method", onchange: (event) => pick(event.target.value) }, campaign.key), null, about("NewCampaign", "method")) : null,
    campaign.kind === "add" ? null : field("Project number", h("input", { value: project.number, autocomplete: "off", "data-keep": "project", oninput: (event) => (project.number = event.target.value) }), null, about("NewCampaign", "project_number")),
  );
}

const picker = (title, sub, checked, key, onchange) => h("label", { class: "picker" }, h("input", { type: "radio", name: "campaign", checked, "data-keep": `campaign ${key}`, onchange }), h("span", {}, title), h("span", { class: "sub" }, sub));

function afterwards({ method, campaign, scenes: all }) {
  const readings = all.filter((each) => each.scene !== undefined).length;
  const steps = campaign.measures ? ["measure the frames"] : [!method.whole_frame && !method.finds_region && "draw the region once", method.finds_region && "draw the region where no code shows the panel", method.reference === "panel" && "choose the panel", method.reference === "meter" && readings && `type ${counted(readings, "meter reading")}`, method.needs_target && "describe the target", method.has_checklist && "sign the checklist", "fit"].filter(Boolean);
  const text = steps.join(", ");
  return h("div", { class: "card" }, h("p", { class: "panel-title" }, "After sending"), h("p", { class: "small" }, `${text.charAt(0).toUpperCase()}${text.slice(1)}.`));
}

function foot({ found, choice }, tell) {
  const size = found.frames.reduce((sum, frame) => sum + frame.size, 0);
  const seconds = (8 * size) / (LINK_MBIT * 1e6);
  const adds = found.campaign.kind === "add";
  const ready = found.frames.length > 0 && (found.camera.complete || adds || choice.registered);
  return h("div", { class: "foot-bar" },
    h("p", {}, h("strong", {}, found.frames.length || !found.here.length ? `${counted(found.frames.length, "frame")}, ${bytes(size)}` : "All frames are there"), h("span", { class: "muted" }, ` ${found.frames.length || !found.here.length ? "to" : "in"} ${adds ? titleOf(found.campaign.campaign) : "a new campaign"}${seconds > 5 ? ` · about ${span(seconds)} at ${LINK_MBIT} Mbit/s` : ""}`)),
    h("p", { class: "actions" }, h("button", { type: "button", class: "quiet", onclick: tell.cancel }, "Cancel"), adds && found.here.length && !found.frames.length ? h("a", { class: "button primary", href: `/campaigns/${found.campaign.campaign.id}` }, "Open the campaign") : h("button", { type: "button", class: "primary", disabled: !ready, "data-keep": "send", onclick: (event) => tell.send(event.target) }, adds ? "Send" : "Create campaign and send")),
  );
}
