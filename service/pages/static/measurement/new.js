// Measure a frame, or all of a night: which, where on it, with what.

import { all, followJob, get, post } from "../api.js";
import { about, decimal, field, manualLink, numberOf, select } from "../ask.js";
import { statedPart } from "../campaign/parameters.js";
import { isRead } from "../campaign/state.js";
import { causeList } from "../causes.js";
import { act, byId, empty, failed, fill, h, leave, load, may } from "../dom.js";
import { counted, day, groupBy, natural, stateWords } from "../format.js";
import { isNight, labelOf, methodOf, titleOf } from "../methods.js";
import { measureOne, regionPart } from "./region.js";

const MOST_NAMED = 5;
const ALL = "all";

const asked = new URL(location.href).searchParams;
const form = byId("new-measurement");
const region = regionPart();
const settings = h("div", { class: "fields" });
const place = h("fieldset", { class: "card" }, h("legend", { class: "legend" }, "Region"), region.element);
const chosen = {};
const averaged = h("select", { multiple: true, size: 4 });
const averagedField = field("Average with", averaged, "Repeats of the same view with the same settings: their noise averages. Optional.", "/docs/measuring#averaging");

load(byId("form"), begin, (drawn) => drawn);
form.addEventListener("submit", (event) => {
  event.preventDefault();
  act(form.querySelector("button[type=submit]"), measure);
});

async function begin() {
  if (!may("upload")) return empty("You cannot measure with this key", "Ask an admin for the permission “send”.");
  chosen.again = asked.has("again") ? await get(`/v1/measurements/${asked.get("again")}`) : undefined;
  const of = chosen.again?.frame_id ?? asked.get("frame");
  const [campaigns, wanted] = await Promise.all([all("/v1/campaigns"), of ? get(`/v1/frames/${of}`) : undefined]);
  if (!campaigns.length) return empty("No campaigns yet", "First send a frame to a campaign of its camera.", h("a", { class: "button", href: "/campaigns" }, "Campaigns"));
  const able = campaigns.filter((each) => methodOf(each.method).measured_quantity).reverse();
  const first = wanted?.campaign_id ?? asked.get("campaign") ?? (able.find(isNight) ?? able[0])?.id;
  const campaign = select(able.map((each) => [each.id, each.project_number ? `${each.project_number}, ${labelOf(each.method)}` : titleOf(each)]), { onchange: () => turnTo(offerFrames) }, first);
  const frame = select([], { onchange: () => turnTo(() => choose(frame.value)) });
  const note = h("div");
  /** What is measured waits for what the last choice asks for. */
  function turnTo(choice) {
    fill(note);
    chosen.ready = choice();
    return chosen.ready.catch((error) => fill(note, failed(error, () => turnTo(choice))));
  }
  async function offerFrames() {
    const of = (chosen.campaign = able.find((each) => each.id === campaign.value));
    fill(frame);
    const [frames, versions, roi] = await Promise.all([framesOf(of), all(`/v1/cameras/${of.camera_id}/calibrations?method=${of.method}`), of.roi_id ? get(`/v1/campaigns/${of.id}/roi`) : null]);
    if (chosen.campaign !== of) return;
    chosen.frames = frames;
    chosen.roi = roi;
    fill(frame, frames.length > 1 ? h("option", { value: ALL, selected: asked.has("all") }, `All ${frames.length} field frames`) : null, frames.map((each, at) => h("option", { value: each.id, selected: wanted ? each.id === wanted.id : !asked.has("all") && !at }, each.filename)));
    fill(note, frames.length ? null : empty("No field frames", "Send frames with the role field to this campaign.", h("a", { class: "button", href: `/campaigns/${of.id}` }, "Open campaign")));
    rest.hidden = !frames.length;
    offerSettings(versions);
    if (frames.length) await choose(frame.value);
  }
  const rest = h("div", { class: "stack-wide" }, place, section("With", settings), h("div", { class: "actions" }, h("button", { type: "submit", class: "primary" }, "Measure"), h("span", { class: "muted", role: "status", id: "progress" })), h("div", { id: "outcome" }));
  await turnTo(offerFrames);
  return h("div", { class: "stack-wide" }, section("Frame", h("div", { class: "fields" }, field("Campaign", campaign, null, "Campaigns whose method measures; the newest measuring night is offered first."), field("Frame", frame, null, "Frames with the role field."), averagedField), note), rest);
}

const section = (title, ...content) => h("fieldset", { class: "card" }, h("legend", { class: "legend" }, title), content);
const framesOf = async ({ id }) => (await all(`/v1/campaigns/${id}/frames?brief=true`)).filter((each) => each.role === "field" && isRead(each)).sort((a, b) => natural(a.filename, b.filename));

async function choose(id) {
  chosen.all = id === ALL;
  const frame = chosen.all ? chosen.frames[0] : chosen.frames.find((each) => each.id === id);
  chosen.frame = frame;
  const alike = chosen.frames.filter((each) => each.id !== id && ["scene", "exposure_time_s", "f_number", "iso"].every((name) => each[name] === frame[name]));
  averaged.parentElement.hidden = chosen.all || !alike.length || !methodOf(chosen.campaign.method).measurement_options.includes("frame_ids");
  fill(averaged, chosen.all ? [] : alike.map((each) => h("option", { value: each.id, selected: chosen.again?.frame_ids?.includes(each.id) }, each.filename)));
  const roi = frame.roi_id && !chosen.all ? await get(`/v1/frames/${id}/roi`) : chosen.roi;
  if (chosen.frame === frame) region.show(chosen.all ? { ...frame, roi_id: null } : frame, roi?.polygon);
  const { frame_id: repeated, region: before, region_origin: origin, grid } = chosen.again ?? {};
  if (chosen.frame === frame && repeated === id && !["frame", "whole_frame"].includes(origin)) region.take(before, grid);
}

function offerSettings(versions) {
  const usable = versions.filter((each) => each.state !== "revoked");
  const usual = [["", "In force at the time of the frame"], ...usable.map((each) => [each.id, `Version ${each.version}, ${stateWords(each.state)}${each.valid_from ? ` from ${day(each.valid_from)}` : ""}`])];
  chosen.calibration = select(usual);
  chosen.map = h("input", { type: "checkbox", checked: true, id: "with-map" });
  const { measurement_options: options, conditions } = methodOf(chosen.campaign.method);
  // a method without options answers with the whole picture
  place.hidden = !options.length;
  region.offer(["drawn", "set", ...(options.includes("grid") ? ["grid", "lanes"] : [])]);
  const { parameters: stated = {} } = chosen.again?.campaign_id === chosen.campaign.id ? chosen.again : {};
  const quantities = [["", "Reflectance of the band"], ["radiance", "Radiance of the band"], ...document.querySelector("main").dataset.indices.split(" ").map((name) => [name, name.toUpperCase()])];
  const isListed = quantities.some(([name]) => name === stated.index);
  chosen.number = decimal({ value: stated.reflectance ?? stated.incidence_angle_deg ?? "" });
  chosen.formula = h("input", { type: "text", maxlength: 200, value: isListed ? "" : (stated.index ?? ""), placeholder: "(nir - red) / (nir + red)" });
  chosen.bands = h("input", { type: "checkbox", id: "with-bands" });
  chosen.index = select(quantities, {}, isListed ? stated.index : stated.quantity);
  chosen.conditions = statedPart(conditions.map((each) => ({ ...each, manual: `/docs/measuring#${options.includes("index") ? "maps" : each.name}` })), stated.conditions && Object.fromEntries(conditions.map(({ field: stored, name }) => [stored, stated.conditions[name]])));
  fill(settings,
    field("Calibration", chosen.calibration, null, about("MeasurementOptions", "calibration_id")),
    options.includes("reflectance") ? field("Reflectance ρ of the surface", chosen.number, "Optional.", about("MeasurementOptions", "reflectance")) : null,
    options.includes("index") ? field("Quantity", chosen.index, null, about("MeasurementOptions", "index")) : null,
    options.includes("index") ? field("Formula", chosen.formula, "Another index of the capture’s bands: names of bands, numbers, + - * / ** and parentheses. Optional.", "/docs/reflectance#maps-and-indices") : null,
    options.includes("incidence_angle_deg") ? field("Incidence angle [°]", chosen.number, "Optional.", about("MeasurementOptions", "incidence_angle_deg")) : null,
    h("p", { class: "field" }, h("span", { class: "label-row" }, h("span", { class: "label" }, "Map"), manualLink("/docs/measuring#maps", "Map")), h("span", { class: "check" }, chosen.map, h("label", { for: "with-map", class: "check" }, "of every pixel"))),
    options.includes("index") ? h("p", { class: "field" }, h("span", { class: "label-row" }, h("span", { class: "label" }, "Bands"), manualLink("/docs/measuring#maps", "Bands")), h("span", { class: "check" }, chosen.bands, h("label", { for: "with-bands", class: "check" }, "all of the capture, aligned in one file"))) : null,
    conditions.length ? h("details", { class: "fold wide" }, h("summary", {}, options.includes("index") ? "Place on the ground" : "Light and surroundings"), chosen.conditions.element) : null,
  );
}

const quantityOf = (name) => (name === "radiance" ? { quantity: name } : name ? { index: name } : {});

async function measure() {
  const progress = byId("progress");
  await chosen.ready;
  const said = numberOf(chosen.number);
  const { measurement_options: options } = methodOf(chosen.campaign.method);
  const name = ["reflectance", "incidence_angle_deg"].find((each) => options.includes(each));
  const repeats = [...averaged.selectedOptions].map((each) => each.value);
  const body = {
    ...(chosen.all ? {} : repeats.length ? { frame_ids: [chosen.frame.id, ...repeats] } : { frame_id: chosen.frame.id }),
    ...(place.hidden ? {} : region.read()),
    ...chosen.conditions.read(),
    ...(said === undefined ? {} : { [name]: said }),
    ...(chosen.calibration.value ? { calibration_id: chosen.calibration.value } : {}),
    ...(options.includes("index") ? quantityOf(chosen.formula.value.trim() || chosen.index.value) : {}),
    ...(chosen.bands.checked ? { products: ["bands"] } : chosen.map.checked ? { products: ["map"] } : {}),
  };
  if (!chosen.all) return measureOne(body, progress);
  try {
    progress.textContent = "Asking…";
    await measureAll(body, progress);
  } finally {
    progress.textContent = "";
  }
}

/** Measure every field frame; the service goes on by itself when this page is left. */
async function measureAll(body, progress) {
  const path = `/campaigns/${chosen.campaign.id}`;
  let measured = 0;
  const { jobs, not_measured: left } = await post(`/v1${path}/measurements`, body);
  for (const [done, begun] of jobs.entries()) {
    progress.textContent = `${done} of ${counted(jobs.length, "frame")} measured. This page may be closed.`;
    const job = await followJob(begun.id);
    if (job.state === "succeeded") measured += 1;
    else left.push({ filename: begun.filename, code: job.error.code, detail: job.error.detail });
  }
  if (!left.length) return leave(`${path}#measure`);
  const causes = [...groupBy(left, (each) => each.detail.replaceAll(each.filename, "")).values()].map((some) => ({
    mark: "warn",
    title: `${counted(some.length, "frame")} not measured`,
    where: `${some[0].detail} ${some.length > 1 ? `The same: ${some.slice(1, MOST_NAMED + 1).map((each) => each.filename).join(", ")}${some.length > MOST_NAMED + 1 ? ` and ${some.length - MOST_NAMED - 1} more` : ""}.` : ""}`,
    actions: [],
  }));
  fill(byId("outcome"), h("p", { class: "note" }, `${counted(measured, "frame")} measured. `, h("a", { href: `${path}#measure` }, "Results")), causeList(causes));
}
