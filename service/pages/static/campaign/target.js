// The target: a board of squares, or a chart of edges or stars. Which, the fields that the method's target has tell.

import { patch } from "../api.js";
import { fill, h, may } from "../dom.js";
import { words } from "../format.js";
import { act, empty, wrong } from "../states.js";
import { choices, decimal, field, numberOf, select } from "./forms.js";

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
    fill(
      counted,
      field(`${what} across`, columns, "As counted by the manufacturer.", BOARD),
      field(`${what} down`, rows, null, BOARD),
      field("Side of a square [mm]", square, "Measured on the print.", BOARD),
      charuco ? [field("Side of a marker [mm]", marker, null, BOARD), field("Dictionary", dictionary, null, BOARD)] : null,
    );
  };
  const element = h(
    "div",
    {},
    h(
      "div",
      { class: "choices", role: "radiogroup", "aria-label": "Board" },
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
  const draw = () =>
    fill(
      more,
      kind === "siemens_star" ? field("Cycles of the star", cycles, "Pairs of a dark and a bright sector.", "/docs/sharpness#siemens-star") : null,
      field("Tone curve to undo", curve, null, CHART),
      curve.value === "gamma" ? field("Gamma", gamma, null, CHART) : null,
    );
  curve.addEventListener("change", draw);
  const element = h(
    "div",
    {},
    h(
      "div",
      { class: "choices", role: "radiogroup", "aria-label": "Chart" },
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
