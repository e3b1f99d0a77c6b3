// What a person should know of a method before choosing it, and what each wants to be told.

export const METHODS = {
  luminance: ["Luminance", "K per ISO value, which converts raw signal into cd/m². Needs lit surfaces with luminance meter readings, and dark frames."],
  reflectance: ["Reflectance", "K per band of a multispectral camera with its sunshine sensor, from a panel of known reflectance."],
  vignetting: ["Vignetting", "Light falloff towards the corners, per f-number, from flat fields."],
  sharpness: ["Sharpness", "MTF from slanted edges or Siemens stars, in the centre and towards the corners."],
  geometry: ["Geometry", "Focal length, principal point and distortion, from images of a board."],
  noise: ["Noise and linearity", "System gain, read noise and dynamic range, from pairs of frames with equal settings."],
};

/** The role that a frame of this method has when nothing else is said. */
export const usualRole = (method) =>
  ({ luminance: "light", reflectance: "panel", vignetting: "flat", sharpness: "chart", geometry: "chart", noise: "flat" })[method] ?? "light";

export const ROLES = ["light", "dark", "flat", "panel", "chart", "field"];

const share = (name, label, hint, low, high) => ({ name, label, hint, kind: "percent", low, high });

/** The models of a luminance fit; the first is the method's default. */
export const MODELS = [
  ["proportional", "Proportional: N = K X"],
  ["affine", "Affine: N = K X + b"],
  ["power", "Power: ln N = ln K + g ln X"],
  ["semilog", "Semilog: only to reproduce an old report"],
];

/** What may be said of a fit; what is left empty takes the method's default. */
export const PARAMETERS = {
  luminance: [
    { name: "model", label: "Model", kind: "choice", options: MODELS },
    share("tolerance", "Tolerance [%]", "4 when left empty: the largest accepted error of L.", 0, 100),
    { name: "channel", label: "Signal", kind: "choice", options: [["green", "Both greens"], ["grey", "All CFA positions"]] },
    { name: "exposure_basis", label: "Exposure values", kind: "choice", options: [["nominal", "Nominal (f/11, 1/60)"], ["apex", "APEX (f/11.3, 1/64)"]] },
    share("meter_repeatability_rel", "Meter’s repeatability [%]", "Estimated from the scatter when left empty.", 0, 100),
  ],
  reflectance: [
    { name: "normalisation", label: "Normalised by", kind: "choice", options: [["sunshine", "The sunshine sensor"], ["panel_only", "The panel alone: holds for one light"]] },
    { name: "sunshine_choice", label: "Sunshine reading", kind: "choice", options: [["mean", "Mean of the valid ones"], ["last", "The last"], ["nearest", "The nearest in time"]] },
    { name: "interpolation", label: "Between panel captures", kind: "choice", options: [["constant", "One K"], ["linear", "K linear in time"]] },
    { name: "incidence_angle_deg", label: "Sun’s angle to the panel [°]", kind: "number", hint: "0 when left empty." },
  ],
  geometry: [
    { name: "pixel_pitch_um", label: "Pixel pitch [µm]", kind: "number", hint: "For millimetres and micrometres in the result." },
    { name: "radial_terms", label: "Radial terms", kind: "choice", whole: true, options: [["3", "k1, k2, k3"], ["2", "k1, k2"], ["1", "k1"], ["0", "None"]] },
    { name: "reject_above_px", label: "Reject views above [px]", kind: "number", hint: "2 when left empty." },
  ],
  sharpness: [
    { name: "pixel_pitch_um", label: "Pixel pitch [µm]", kind: "number", hint: "For line pairs per millimetre." },
  ],
};
