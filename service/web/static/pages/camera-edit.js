// The names, lens and pixel pitch of a camera, corrected.

import { get, patch } from "../api.js";
import { ask } from "../ask.js";
import { readNumber, wrong } from "../campaign/numbers.js";

const TEXTS = [["make", "Make"], ["model", "Model"], ["serial", "Serial number"]];
const LENS = [["make", "Lens make"], ["model", "Lens model"], ["serial", "Lens serial number"]];
const NUMBERS = [["pixel_pitch_um", "Pixel pitch [µm]"], ["sensor_width_mm", "Sensor width [mm]"]];

/** Answers the camera as it then is, or undefined. */
export async function editCamera(id) {
  const camera = await get(`/v1/cameras/${id}`);
  return ask({
    title: "Edit camera",
    fields: [
      ...TEXTS.map(([name, label]) => ({ name, label, of: "NewCamera", value: camera[name], hint: name === "serial" ? "With other names the frames of its campaigns are checked again." : undefined })),
      ...LENS.map(([name, label]) => ({ name: `lens_${name}`, label, of: ["Lens", name], value: camera.lens?.[name] ?? "", required: false })),
      ...NUMBERS.map(([name, label]) => ({ name, label, of: "NewCamera", value: camera[name] ?? "", required: false, inputmode: "decimal" })),
      { name: "note", label: "Note", of: "NewCamera", type: "textarea", value: camera.note ?? "", required: false },
    ],
    submit: "Save",
    action: (values) => {
      const said = Object.fromEntries(TEXTS.map(([name]) => [name, values[name]]));
      for (const [name, label] of NUMBERS) {
        if (!values[name]) continue;
        said[name] = readNumber(values[name]);
        if (!(said[name] > 0)) throw wrong(`${label}: “${values[name]}” is not a number above 0.`);
      }
      const lens = Object.fromEntries(LENS.filter(([name]) => values[`lens_${name}`]).map(([name]) => [name, values[`lens_${name}`]]));
      if (Object.keys(lens).length) said.lens = lens;
      return patch(`/v1/cameras/${id}`, { ...said, note: values.note ?? "" });
    },
  });
}
