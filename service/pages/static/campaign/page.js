// The page of one campaign, from its first file to its calibration.

import { patch } from "../api.js";
import { act, byId, failed, fill, h, isPressed, mark, may } from "../dom.js";
import { counted, number } from "../format.js";
import { atNight, methodOf } from "../methods.js";
import { gridSection } from "./grid.js";
import { beforeTheFit, causesOf, readinessOf } from "../causes.js";
import { refusedCauses } from "./moves.js";
import { CampaignState, countOwn } from "./state.js";

function overview(state) {
  const element = h("div", { class: "overview" });
  const opens = (name) => (event) => act(event.target, async () => (await import("./target.js"))[name](state));
  const dialogs = { panel: opens("choosePanel"), meter: opens("stateMeter"), camera: () => location.assign(`/cameras/${state.campaign.camera_id}`) };
  const draw = () => {
    if (isPressed(element)) return void requestAnimationFrame(draw);
    const open = element.querySelector("details")?.open ?? false;
    fill(element, stages(state), offer(state), beforeTheFit(state.campaign, state.method.measures ? "Before measuring" : "Before the fit", { refused: refusedCauses(state), sending: state.sending, dialogs }));
    element.querySelector("details")?.toggleAttribute("open", open);
  };
  state.on("campaign", draw);
  for (const name of ["frames", "sending", "checklist", "fitted"]) state.on(name, draw);
  draw();
  return element;
}

function countOutcomes(state) {
  const counts = { pass: 0, warn: 0, fail: 0, pending: 0 };
  for (const frame of state.frames) counts[frame.outcome] += 1;
  return counts;
}

function stages(state) {
  const { campaign, method, scenes } = state;
  const counts = countOutcomes(state);
  const received = Math.max(campaign.frames.received, state.frames.length);
  const told = [counts.pass && `${counts.pass} pass`, counts.warn && `${counts.warn} to check`, counts.fail && `${counts.fail} fail`, counts.pending && `${counts.pending} waiting`];
  const lacksReadings = causesOf(campaign).some(({ part }) => part === "readings");
  const ready = readinessOf(campaign, state.sending);
  const list = state.checklist;
  const fitted = state.fitted?.length;
  return h("ol", { class: "stages", "aria-label": "Stages" }, [
    stage("frames", !received ? "gap" : counts.fail ? "bad" : counts.warn ? "warn" : counts.pending ? "wait" : "good", "Frames", [received ? `${number(received, 6)} received` : "none yet", ...told]),
    region(state),
    method.reference === "meter" && !method.measures ? stage("readings", campaign.readings ? (lacksReadings ? "warn" : "good") : "gap", "Readings", [campaign.readings ? `${counted(campaign.readings, "reading")}, ${counted(scenes.length, "scene")}` : "none yet"]) : null,
    method.has_checklist && !method.measures ? stage("checklist", list?.signature && !list.signature.changed ? "good" : "wait", "Checklist", [list?.signature ? (list.signature.changed ? "changed since it was signed" : "signed") : list ? `${list.done} of ${list.done + list.open} done` : "by section"]) : null,
    method.measures ? stage("measure", campaign.measured ? "good" : "wait", "Measured", [campaign.measured ? counted(campaign.measured, "field frame") : "none yet", "never used to calibrate"]) : stage("calibrate", fitted ? "good" : ready.count ? "warn" : "wait", "Fit", [fitted ? counted(fitted, "version") : ready.said]),
  ]);
}

const stage = (part, kind, name, said) => h("li", {}, h("a", { href: `#${part}` }, mark(kind), h("strong", {}, name), h("span", {}, said.filter(Boolean).join(" · "))));

function region({ roi, method, frames }) {
  const { own, found, said } = countOwn(frames);
  if (roi) return stage("region", "good", "Region", [roi.regions ? counted(roi.regions.length, "part") : counted(roi.polygon.length, "corner"), said]);
  if (method.whole_frame && !method.measures) return stage("region", "good", "Region", ["whole frame", said]);
  return stage("region", own || method.measures ? "good" : "gap", "Region", [own ? (found === own ? "found" : "per frame") : method.measures ? "or with the measurement" : "none yet", said]);
}

/** Another panel than the campaign's: one click names it, and registers it as its files state it. */
function offer(state) {
  const panel = state.campaign.panel_offered;
  if (!panel) return null;
  const stated = panel.bands.map((band) => `${band.band} ${number(band.reflectance)}`).join(", ");
  const known = panel.registered ? "It is registered." : stated ? `Its files state ${stated}.` : "Its files do not state what it reflects: register it.";
  const button = h("button", { type: "button" }, `Use panel ${panel.serial}`);
  const take = async () => {
    await patch(state.path, { panel_serial: panel.serial });
    await state.touch();
  };
  button.addEventListener("click", () => act(button, take));
  return h("div", { class: "note warn" }, h("h2", {}, `The frames show panel ${panel.serial}`), h("p", {}, `It is not the campaign’s panel. ${known}`), may("calibrate") && (panel.registered || stated) ? h("p", { class: "actions" }, button) : null);
}

const { campaignId, method, kind } = document.querySelector("main").dataset;
const state = new CampaignState(campaignId, kind === "measurement" ? atNight(methodOf(method)) : methodOf(method));

start();

async function start() {
  // the frames are there first, and are drawn before anything else is asked
  const known = (await drawn("frame-list", () => state.open(), gridSection)) && (await drawn("overview", () => state.know(), overview));
  // all that a slow line brings after them
  const { PARTS, uploadSection } = await import("./parts.js");
  if (state.left) return;
  if (may("upload")) fill(byId("upload"), uploadSection(state));
  if (!known) {
    for (const place of document.querySelectorAll("main .region[aria-busy]")) fill(place).removeAttribute("aria-busy");
    return;
  }
  // a method that has no readings has no such part; the form is there where no target is
  for (const [id, part] of PARTS) if (byId(id)) await drawn(id, () => {}, part);
  // what the address names has only now got its place
  if (location.hash) document.querySelector(`section${CSS.escape(location.hash).replace("\\#", "#")}`)?.scrollIntoView();
}

/** One part, once what it shows is there; if that fails, everything begins again. */
async function drawn(id, ready, part) {
  const place = byId(id);
  try {
    await ready();
    if (state.left) return false;
    fill(place, part(state));
    return true;
  } catch (error) {
    fill(place, failed(error, () => location.reload()));
    return false;
  } finally {
    place.removeAttribute("aria-busy");
  }
}
