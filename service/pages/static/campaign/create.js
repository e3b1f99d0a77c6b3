// A new campaign: method, camera, target and details.

import { all, post } from "../api.js";
import { act, byId, fill, h, leave, load } from "../dom.js";
import { cameraName, inOrder } from "../format.js";
import { METHODS, methodOf } from "../methods.js";
import { DETAILS, detailsOf, isOfLens } from "./details.js";
import { about, choices, field, filled, numberOf, select } from "../ask.js";
import { statedPart, withManual } from "./parameters.js";
import { panelPart, targetPart } from "./target.js";

const NEW = "new";
const form = byId("new-campaign");
let method = null;
let night = false;
const needsPanel = () => !night && method?.reference === "panel";
let target = null;
let stated = null;
let camera = { read: () => ({}) };
/** The lens is asked for with the camera; another one is entered later. */
const ASKED = DETAILS.filter(({ name }) => !isOfLens(name));
fill(byId("details"), ASKED.map(({ name, label, type }) => field(label, type === "textarea" ? h("textarea", { id: name, name, rows: "2" }) : h("input", { id: name, name, type, autocomplete: "off" }), null, about("NewCampaign", name))));

let panel = { read: () => undefined };

fill(byId("kinds"), choices("kind", [["calibration", "Calibration", "Frames and readings that a version is fitted from."], ["measurement", "Measuring night", "Field frames that are measured with a published version; never used to calibrate."]], turn));
turn("calibration");
load(byId("camera"), () => all("/v1/cameras"), (cameras) => (camera = cameraPart(cameras)).element);
load(byId("panel"), () => all("/v1/panels"), (panels) => (panel = panelPart(panels)).element).then(offerPanel);

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

/** What is not shown must not have to be filled in either. */
function offerPanel() {
  for (const control of byId("panel").querySelectorAll("input, select, textarea")) control.disabled = !needsPanel();
}

async function create() {
  const said = filled(form);
  const details = detailsOf(Object.fromEntries(ASKED.filter(({ name }) => said[name]).map(({ name }) => [name, said[name]])));
  const body = { method: method.name, kind: night ? "measurement" : "calibration", ...details };
  Object.assign(body, stated.read());
  if (target) body.target = target.read(); // left out where there is no form
  if (needsPanel()) body.panel_id = await panel.read();
  body.camera_id = await camera.read();
  const made = await post("/v1/campaigns", body);
  await leave(`/campaigns/${made.id}`);
}

function cameraPart(cameras) {
  const known = inOrder(cameras, cameraName).map((each) => [each.id, cameraName(each)]);
  // frames of another camera are refused: of several, none is taken for granted
  const several = known.length > 1 ? [["", "Select…"]] : [];
  const chosen = select([...several, ...known, [NEW, "Register another…"]], { name: "camera_id", required: true }, several.length ? "" : known[0]?.[0]);
  const make = h("input", { autocomplete: "off" });
  const model = h("input", { autocomplete: "off" });
  const serial = h("input", { autocomplete: "off" });
  const lens = [h("input", { autocomplete: "off" }), h("input", { autocomplete: "off" })];
  const pitch = h("input", { inputmode: "decimal", autocomplete: "off" });
  const fresh = h("fieldset", {},
    h("legend", {}, "New camera"),
    h("div", { class: "fields" },
      field("Make", make, null, about("NewCamera", "make")),
      field("Model", model, null, about("NewCamera", "model")),
      field("Serial number", serial, null, about("NewCamera", "serial")),
      field("Lens make", lens[0], null, about("Lens", "make")),
      field("Lens model", lens[1], null, about("Lens", "model")),
      field("Pixel pitch [µm]", pitch, null, about("NewCamera", "pixel_pitch_um")),
    ),
  );
  const show = () => {
    fresh.hidden = chosen.value !== NEW;
    for (const input of [make, model, serial]) input.required = !fresh.hidden;
  };
  chosen.addEventListener("change", show);
  show();
  const element = h("div", {}, known.length ? field("Camera", chosen, null, about("NewCampaign", "camera_id")) : null, fresh);
  const read = async () => {
    if (chosen.value !== NEW) return chosen.value;
    const body = { make: make.value.trim(), model: model.value.trim(), serial: serial.value.trim(), pixel_pitch_um: numberOf(pitch) };
    const [lensMake, lensModel] = lens.map((input) => input.value.trim() || undefined);
    // one without the other is refused, and said so
    if (lensMake || lensModel) body.lens = { make: lensMake, model: lensModel };
    return (await post("/v1/cameras", body)).id;
  };
  return { element, read };
}
