// What a campaign is measured against: its target, panel and meters.

import { all, patch, post } from "../api.js";
import { about, ask, field, numberOf, readNumber, registry } from "../ask.js";
import { act, empty, h, may, wrong } from "../dom.js";
import { words } from "../format.js";

/** {element, read()}: the form of the page for such a target, and the target as the API wants it. */
export function targetPart({ label, target_fields: fields }, standing = {}) {
  const form = [...document.querySelectorAll("template[data-target]")].find((each) => fields.includes(each.dataset.target));
  if (!form) return { element: empty("No form for this target", `Send the target of a ${label} campaign to the API: ${fields.join(", ")}.`), read: () => undefined };
  const element = form.content.firstElementChild.cloneNode(true);
  const controls = [...element.querySelectorAll("[name]")];
  const nameOf = (control) => control.name.replace("target-", "");
  for (const control of controls) {
    const value = standing[nameOf(control)];
    if (control.type === "radio") control.checked = value === undefined ? control.checked : control.value === value;
    else control.value = value ?? control.value;
  }
  const show = () => {
    const chosen = controls.filter((each) => each.checked || each.matches("select")).map((each) => each.value);
    for (const part of element.querySelectorAll("[data-when]")) {
      part.hidden = !chosen.includes(part.dataset.when);
      part.querySelector("[name]").disabled = part.hidden;
    }
  };
  element.addEventListener("change", show);
  show();
  const valueOf = (control) => (control.inputMode ? numberOf(control, { integer: control.inputMode === "numeric" }) : control.value);
  const read = () => Object.fromEntries(controls.filter((each) => !each.disabled && (each.type !== "radio" || each.checked)).map((each) => [nameOf(each), valueOf(each)]));
  return { element, read };
}

/** On the page of a campaign, folded where it is known, as one that began with a card may have another kind: a change begins everything again. */
export function targetSection(state) {
  const standing = state.campaign.target;
  if (!may("calibrate")) return standing ? h("p", {}, words(standing.kind)) : empty("No target yet", "Frames are measured once the target is entered.");
  const { element, read } = targetPart(state.method, standing);
  const button = h("button", { class: "primary", type: "submit" }, "Find it in the frames");
  const say = async () => {
    await patch(state.path, { target: read() });
    location.reload();
  };
  const form = h("form", { class: "card", oninput: () => (state.unused.target = true), onsubmit: (event) => (event.preventDefault(), act(button, say)) }, element, h("p", { class: "actions" }, button));
  return standing ? h("details", { class: "fold" }, h("summary", {}, `Change: ${words(standing.kind)}`), form) : form;
}

const registerPanel = (serial) => ask({
  title: "Register a panel",
  fields: [
    { name: "serial", label: "Serial number", of: "NewPanel", value: serial },
    { name: "measured_on", label: "Measured on", of: "NewPanel", type: "date" },
    { name: "bands", label: "Reflectance", of: "NewPanel", type: "textarea", rows: 5, hint: "One line per band: green 0.69 0.005 (band, reflectance, and its standard uncertainty if known)." },
  ],
  submit: "Register",
  action: ({ bands, ...said }) => post("/v1/panels", { ...said, bands: readBands(bands) }),
});

export const panelField = (panels, chosen, offered) => field("Panel", registry(panels, { nameOf: ({ serial, bands, measured_on: day }) => `${serial}, ${bands.some((band) => band.origin) ? "stated by files of" : "measured"} ${day} (${bands.map((each) => each.band).join(", ")})`, register: () => registerPanel(offered), none: "As named in the files, or the only one", name: "panel_id" }, chosen), null, about("NewCampaign", "panel_id"));

/** A campaign that began without its panel, as one from a card does, is told it in a dialog. */
export async function choosePanel(state) {
  const panels = await all("/v1/panels");
  const offered = state.campaign.panel_offered?.serial;
  const name = (panel_id) => patch(state.path, { panel_id });
  if (panels.length) await ask({ title: "Panel of this campaign", body: panelField(panels, state.campaign.panel_id, offered), submit: "Save", action: ({ panel_id }) => name(panel_id) });
  else {
    const made = await registerPanel(offered);
    if (made) await name(made.id);
  }
  await state.touch();
}

function readBands(text) {
  const lines = text.split("\n").map((line, index) => [index + 1, line.trim()]);
  return lines.filter(([, line]) => line).map(([number, line]) => {
    // a band's name may have two words, such as "Red edge": the numbers come last
    const said = line.split(/[\s;]+/);
    const figures = said.slice(-2).map(readNumber).filter((value) => !Number.isNaN(value));
    const band = said.slice(0, said.length - figures.length).join(" ");
    const [reflectance, uncertainty] = figures;
    if (!band || Number.isNaN(readNumber(said.at(-1)))) throw wrong(`Line ${number}: “${line}” should read as green 0.69 0.005.`);
    return { band, reflectance, ...(uncertainty === undefined ? {} : { standard_uncertainty: uncertainty }) };
  });
}

export const nameOfMeter = (meter) => meter && `${meter.make} ${meter.model} ${meter.serial}`;

/** Ask for a meter, or for the next certificate of one; answers it as it was registered, or undefined. */
export const askForMeter = (meter = {}) => ask({
  title: meter.id ? "Add a certificate" : "Register a meter",
  fields: [
    { name: "kind", label: "Kind", of: "NewMeter", options: [["luminance", "Luminance meter"], ["illuminance", "Illuminance meter"], ["sunshine", "Sunshine sensor"]], value: meter.kind },
    { name: "make", label: "Make", of: "NewMeter", value: meter.make },
    { name: "model", label: "Model", of: "NewMeter", value: meter.model },
    { name: "serial", label: "Serial number", of: "NewMeter", value: meter.serial },
    { name: "number", label: "Certificate number", of: ["Certificate", "number"], required: false },
    { name: "laboratory", label: "Laboratory", of: ["Certificate", "laboratory"], required: false },
    { name: "issued_on", label: "Issued on", of: ["Certificate", "issued_on"], type: "date", required: false },
    { name: "due_on", label: "Due on", of: ["Certificate", "due_on"], type: "date", required: false },
    { name: "uncertainty", label: "Expanded uncertainty [%]", of: ["Certificate", "expanded_uncertainty_rel"], required: false },
    { name: "coverage", label: "Coverage factor", of: ["Certificate", "coverage_factor"], value: "2", required: false },
  ],
  submit: meter.id ? "Add" : "Register",
  action: ({ kind, make, model, serial, ...rest }) => post("/v1/meters", { kind, make, model, serial, ...certificateOf(rest) }),
});

/** A meter of the readings without a certificate gets one; where they name no meter it can be chosen. */
export async function stateMeter(state) {
  const [meters, readings] = await Promise.all([all("/v1/meters"), state.readings()]);
  const used = new Set(readings.filter((each) => !each.withdrawn_at).map((each) => each.meter_id));
  const lacking = meters.find((each) => used.has(each.id) && !each.certificate);
  if (!lacking) document.querySelector(".reading-tools [aria-label^=Meter]").focus();
  else if (await askForMeter(lacking)) await state.touch();
}

function certificateOf({ number, laboratory, issued_on, due_on, uncertainty, coverage }) {
  if (!number && !laboratory && !issued_on && !uncertainty) return {};
  if (!number || !laboratory || !issued_on || !due_on || !uncertainty || !coverage) throw wrong("Enter number, laboratory, both dates, uncertainty and coverage factor of the certificate, or leave all of them empty.");
  const [percent, factor] = [readNumber(uncertainty), readNumber(coverage)];
  if (!(percent > 0 && percent < 100) || !(factor >= 1)) throw wrong("The uncertainty is a percentage such as 2, the coverage factor a number such as 2.");
  return { certificate: { number, laboratory, issued_on, due_on, expanded_uncertainty_rel: percent / 100, coverage_factor: factor } };
}
