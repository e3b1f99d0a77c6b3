// The names, lens and pixel pitch of a camera: registered, or corrected.

import { get, patch, post } from "../api.js";
import { ask, readNumber } from "../ask.js";
import { wrong } from "../dom.js";

const TEXTS = [["make", "Make"], ["model", "Model"], ["serial", "Serial number"]];
const LENS = [["make", "Lens make"], ["model", "Lens model"], ["serial", "Lens serial number"]];
const NUMBERS = [["pixel_pitch_um", "Pixel pitch [µm]"], ["sensor_width_mm", "Sensor width [mm]"]];

export async function editCamera(id) {
  const camera = await get(`/v1/cameras/${id}`);
  return ask({
    title: "Edit camera",
    fields: [...fieldsOf(camera, "With other names the frames of its campaigns are checked again."), { name: "note", label: "Note", of: "NewCamera", type: "textarea", value: camera.note ?? "", required: false }],
    submit: "Save",
    action: (values) => patch(`/v1/cameras/${id}`, { ...bodyOf(values), note: values.note ?? "" }),
  });
}

/** Answers the camera that was registered, or undefined; `known` of it is filled in. */
export const registerCamera = (known = {}) => ask({ title: "Register a camera", fields: fieldsOf(known, "Of the camera body, as it writes it into its files."), submit: "Register", action: (values) => post("/v1/cameras", bodyOf(values)) });

const fieldsOf = (camera, hint) => [
  ...TEXTS.map(([name, label]) => ({ name, label, of: "NewCamera", value: camera[name] ?? "", hint: name === "serial" ? hint : undefined })),
  ...LENS.map(([name, label]) => ({ name: `lens_${name}`, label, of: ["Lens", name], value: camera.lens?.[name] ?? "", required: false })),
  ...NUMBERS.map(([name, label]) => ({ name, label, of: "NewCamera", value: camera[name] ?? "", required: false, inputmode: "decimal" })),
];

function bodyOf(values) {
  const said = Object.fromEntries(TEXTS.map(([name]) => [name, values[name]]));
  for (const [name, label] of NUMBERS) {
    if (!values[name]) continue;
    said[name] = readNumber(values[name]);
    if (!(said[name] > 0)) throw wrong(`${label}: “${values[name]}” is not a number above 0.`);
  }
  const lens = Object.fromEntries(LENS.filter(([name]) => values[`lens_${name}`]).map(([name]) => [name, values[`lens_${name}`]]));
  return Object.keys(lens).length ? { ...said, lens } : said;
}
