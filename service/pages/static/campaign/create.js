// A new campaign: method, camera, target and details.

import { all, post } from "../api.js";
import { act, byId, fill, h, leave, load } from "../dom.js";
import { cameraName } from "../format.js";
import { METHODS, methodOf } from "../methods.js";
import { registerCamera } from "../pages/camera-edit.js";
import { DETAILS, detailsOf, isOfLens } from "./details.js";
import { about, choices, field, filled, registry } from "../ask.js";
import { statedPart, withManual } from "./parameters.js";
import { panelField, targetPart } from "./target.js";

const form = byId("new-campaign");
let method = null;
let night = false;
const needsPanel = () => !night && method?.reference === "panel";
let target = null;
let stated = null;
/** The lens is asked for with the camera; another one is entered later. */
const ASKED = DETAILS.filter(({ name }) => !isOfLens(name));
fill(byId("details"), ASKED.map(({ name, label, type }) => field(label, type === "textarea" ? h("textarea", { id: name, name, rows: "2" }) : h("input", { id: name, name, type, autocomplete: "off" }), null, about("NewCampaign", name))));

fill(byId("kinds"), choices("kind", [["calibration", "Calibration", "Frames and readings that a version is fitted from."], ["measurement", "Measuring night", "Field frames that are measured with a published version; never used to calibrate."]], turn));
turn("calibration");
load(byId("camera"), () => all("/v1/cameras"), cameraField);
load(byId("panel"), () => all("/v1/panels"), (panels) => panelField(panels)).then(offerPanel);

form.addEventListener("submit", (event) => {
  event.preventDefault();
  act(event.submitter ?? form.querySelector("button[type=submit]"), create);
});

function turn(kind) {
  night = kind === "measurement";
  const able = METHODS.filter((each) => !night || each.measured_quantity);
  fill(byId("methods"), choices("method", able.map((each) => [each.name, each.label, night ? `Frames become ${each.measured_quantity}.` : each.description]), choose, able.includes(method) ? method.name : null));
  choose(able.includes(method) ? method.name : null);
}

function choose(name) {
  method = methodOf(name);
  target = method?.needs_target && !night ? targetPart(method) : null;
  byId("target-section").hidden = target === null;
  byId("panel-section").hidden = !needsPanel();
  const light = method?.conditions.map((each) => each.name);
  const given = method?.parameters.filter((each) => each.given_by === "campaign" && (!night || light.includes(each.name))) ?? [];
  stated = statedPart(method ? withManual(given, method) : given);
  byId("stated-head").textContent = night ? "Light" : "Light, distance and verdict";
  byId("stated-section").hidden = !given.length;
  fill(byId("stated"), stated.element);
  fill(byId("target"), target?.element);
  offerPanel();
}

function cameraField(cameras) {
  // frames of another camera are refused: of several, none is taken for granted
  const only = cameras.length === 1 ? cameras[0].id : "";
  const list = registry(cameras, { nameOf: cameraName, register: () => registerCamera(), none: "Select…", name: "camera_id", required: true }, only);
  return field("Camera", list, null, about("NewCampaign", "camera_id"));
}

/** What is not shown must not have to be filled in either. */
function offerPanel() {
  for (const control of byId("panel").querySelectorAll("input, select, textarea")) control.disabled = !needsPanel();
}

async function create() {
  const said = filled(form);
  const details = detailsOf(Object.fromEntries(ASKED.filter(({ name }) => said[name]).map(({ name }) => [name, said[name]])));
  const { camera_id, panel_id, kind } = said;
  const made = await post("/v1/campaigns", { method: method.name, kind, ...details, ...stated.read(), target: target?.read(), panel_id, camera_id });
  await leave(`/campaigns/${made.id}`);
}
