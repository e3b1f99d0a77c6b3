// What a campaign is measured against: its target, panel and meters.

import { all, patch, post } from "../api.js";
import { about, ask, choices, decimal, field, numberOf, readNumber, registry, select } from "../ask.js";
import { act, empty, fill, h, may, wrong } from "../dom.js";
import { words } from "../format.js";

// where the manual has them
const [BOARD, CHART] = ["/docs/geometry#the-target", "/docs/sharpness#photographing-the-target"];
const DICTIONARIES = ["DICT_4X4_50", "DICT_4X4_100", "DICT_5X5_50", "DICT_5X5_100", "DICT_6X6_250", "DICT_7X7_250", "DICT_ARUCO_ORIGINAL"];

/** {element, read()}: the form, and the target as the API wants it. */
export function targetPart({ label, target_fields: fields }, standing = {}) {
  if (fields.includes("square_size_mm")) return board(standing);
  if (fields.includes("tone_curve")) return chart(standing);
  return { element: empty("No form for this target", `Send the target of a ${label} campaign to the API: ${fields.join(", ")}.`), read: () => undefined };
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
  const form = h("form", { class: "card", onsubmit: (event) => (event.preventDefault(), act(button, say)) }, element, h("p", { class: "actions" }, button));
  return standing ? h("details", { class: "fold" }, h("summary", {}, `Change: ${words(standing.kind)}`), form) : form;
}

function board(standing) {
  let kind = standing.kind ?? "checkerboard";
  const columns = decimal({ inputmode: "numeric", required: true, value: standing.columns ?? "" });
  const rows = decimal({ inputmode: "numeric", required: true, value: standing.rows ?? "" });
  const square = decimal({ required: true, value: standing.square_size_mm ?? "" });
  const marker = decimal({ value: standing.marker_size_mm ?? "" });
  const dictionary = select(DICTIONARIES.map((name) => [name, name]), {}, standing.dictionary ?? "DICT_5X5_100");
  const counted = h("div", { class: "fields" });
  const draw = () => {
    const charuco = kind === "charuco";
    const what = charuco ? "Squares" : "Inner corners";
    marker.required = charuco;
    fill(counted,
      field(`${what} across`, columns, "As counted by the manufacturer.", BOARD),
      field(`${what} down`, rows, null, BOARD),
      field("Side of a square [mm]", square, "Measured on the print.", BOARD),
      charuco ? [field("Side of a marker [mm]", marker, null, BOARD), field("Dictionary", dictionary, null, BOARD)] : null,
    );
  };
  const element = h("div", {},
    h("div", { class: "choices", role: "radiogroup", "aria-label": "Board" },
      choices("board", [["checkerboard", "Checkerboard", "The whole board must be visible."], ["charuco", "ChArUco board", "With markers: a part of the board is sufficient."]], (chosen) => ((kind = chosen), draw()), kind),
    ),
    counted,
  );
  draw();
  const read = () => {
    const said = { kind, columns: numberOf(columns, { integer: true }), rows: numberOf(rows, { integer: true }), square_size_mm: numberOf(square) };
    if (kind === "charuco") Object.assign(said, { marker_size_mm: numberOf(marker), dictionary: dictionary.value });
    if (said.columns === undefined || said.rows === undefined || said.square_size_mm === undefined) throw wrong("Enter columns, rows and the size of a square.");
    return said;
  };
  return { element, read };
}

function chart(standing) {
  let kind = standing.kind ?? "slanted_edge";
  const cycles = decimal({ inputmode: "numeric", value: standing.cycles ?? "48" });
  const curve = select([["linear", "Raw files: none"], ["srgb", "sRGB images"], ["gamma", "Images with a pure gamma"]], {}, standing.tone_curve ?? "linear");
  const gamma = decimal({ value: standing.gamma ?? "2.2" });
  const more = h("div", { class: "fields" });
  const draw = () => fill(more,
    kind === "siemens_star" ? field("Cycles of the star", cycles, "Pairs of a dark and a bright sector.", "/docs/sharpness#siemens-star") : null,
    field("Tone curve to undo", curve, null, CHART),
    curve.value === "gamma" ? field("Gamma", gamma, null, CHART) : null,
  );
  curve.addEventListener("change", draw);
  const element = h("div", {},
    h("div", { class: "choices", role: "radiogroup", "aria-label": "Chart" },
      choices("chart", [["slanted_edge", "Slanted edges", "Each region shows one edge, tilted by a few degrees."], ["siemens_star", "Siemens stars", "Each region shows one star."]], (chosen) => ((kind = chosen), draw()), kind),
    ),
    more,
  );
  draw();
  const read = () => ({
    kind,
    tone_curve: curve.value,
    ...(kind === "siemens_star" ? { cycles: numberOf(cycles, { integer: true }) } : {}),
    ...(curve.value === "gamma" ? { gamma: numberOf(gamma) } : {}),
  });
  return { element, read };
}

const registerPanel = () => ask({
  title: "Register a panel",
  fields: [
    { name: "serial", label: "Serial number", of: "NewPanel" },
    { name: "measured_on", label: "Measured on", of: "NewPanel", type: "date" },
    { name: "bands", label: "Reflectance", of: "NewPanel", type: "textarea", rows: 5, hint: "One line per band: green 0.69 0.005 (band, reflectance, and its standard uncertainty if known)." },
  ],
  submit: "Register",
  action: ({ bands, ...said }) => post("/v1/panels", { ...said, bands: readBands(bands) }),
});

const nameOfPanel = ({ serial, bands, measured_on: day }) => `${serial}, ${bands.some((band) => band.origin) ? "stated by files of" : "measured"} ${day} (${bands.map((each) => each.band).join(", ")})`;

export const panelField = (panels, chosen) => field("Panel", registry(panels, { nameOf: nameOfPanel, register: registerPanel, none: "As named in the files, or the only one", name: "panel_id" }, chosen), null, about("NewCampaign", "panel_id"));

/** A campaign that began without its panel, as one from a card does, is told it in a dialog. */
export async function choosePanel(state) {
  const panels = await all("/v1/panels");
  const name = (panel_id) => patch(state.path, { panel_id });
  if (panels.length) await ask({ title: "Panel of this campaign", body: panelField(panels, state.campaign.panel_id), submit: "Save", action: ({ panel_id }) => name(panel_id) });
  else {
    const made = await registerPanel();
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
