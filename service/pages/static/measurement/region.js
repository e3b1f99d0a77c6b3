// Region of a measurement: as set before, drawn here, or a rectangle on the ground with cells.

import { post, runJob } from "../api.js";
import { RegionCanvas, RegionEditor } from "../campaign/canvas.js";
import { about, choices, decimal, field, numberOf, readNumber } from "../ask.js";
import { fill, h, leave, wrong } from "../dom.js";
import { detailOf } from "../causes.js";
import { number } from "../format.js";
import { LANES, cellLines, laneGrid } from "./surface.js";

/** Measure and go there; `told` says how far it is. */
export const measureOne = async (body, told) => leave(`/measurements/${(await runJob("/v1/measurements", body, told, "Measuring")).measurement_id}`);

const KINDS = [
  ["drawn", "New region", "A polygon for this measurement only; of several frames, the same in each."],
  ["set", "Existing region", "The region of each frame, else that of its campaign."],
  ["grid", "Surface with cells", "Four corners of a rectangle on the ground, in the order top left, top right, bottom right, bottom left. Returns L of each cell and the uniformity."],
  ["lanes", "Lane grid", "Lanes between two luminaires with the points of EN 13201-3: four road points, the first two along the lanes, around all lanes."],
];

/** What is typed of each kind, as the API names it: [name, label, value, hint?]. */
const SIZES = {
  grid: [["rows", "Rows of cells", 3], ["columns", "Columns of cells", 5]],
  lanes: [...LANES, ["length_m", "Length of the rectangle [m]", "", "Empty: the spacing."]],
};
const PAUSE_MS = 250;

/** `place(canvas)`: where the canvas goes, if not into the part itself; `kinds`: those offered. */
export function regionPart({ place = null, kinds: offered = KINDS.map(([name]) => name) } = {}) {
  const editor = new RegionEditor();
  const canvas = new RegionCanvas(editor);
  let kind = "drawn";
  let before = [];
  let frameId;
  let waiting;
  const inputs = Object.fromEntries(Object.values(SIZES).flat().map(([name, , value]) => [name, decimal({ value })]));
  const sizes = Object.entries(SIZES).map(([name, some]) => [name, h("div", { class: "fields" }, some.map(([each, label, , hint]) => field(label, inputs[each], hint, about("NewGrid", each))))]);
  const button = (text, onclick) => h("button", { type: "button", onclick }, text);
  const tools = h("div", { class: "roi-toolbar", role: "toolbar", "aria-label": "Drawing" }, button("Rectangle", () => editor.rectangle()), button("Redraw", () => editor.clear()), button("Undo", () => editor.undo()), button("Fit to view", () => canvas.fit()));
  const typed = h("input", { autocomplete: "off", spellcheck: "false", onchange: () => take(typed.value) });
  const corners = field("Corners", typed, "x,y pairs in pixels, separated by blanks, from the top left of the image.", about("NewRoi", "polygon"));
  const note = h("p", { class: "hint" });
  const checked = h("div", { class: "region-checked", "aria-live": "polite" });
  const drawing = h("div", { class: "region-drawing" }, place ? null : canvas.element, tools, corners, sizes.map(([, each]) => each), checked);
  const kinds = h("div", { class: "choices", role: "radiogroup", "aria-label": "Region", hidden: offered.length < 2 }, choices("region", KINDS.filter(([name]) => offered.includes(name)), turn, kind));
  place?.(canvas);
  const element = h("div", { class: "region-part" }, kinds, note, drawing);
  editor.addEventListener("settled", () => (typed.value = editor.points.map((point) => point.join(",")).join(" ")));
  for (const event of ["change", "settled"]) editor.addEventListener(event, drawCells);
  for (const input of Object.values(inputs)) input.addEventListener("input", drawCells);
  turn(kind);

  /** The cells over the picture, as soon as there are four corners. */
  function drawCells() {
    const points = editor.points;
    const ready = kind in SIZES && points.length === 4;
    const typed = (name) => readNumber(inputs[name].value);
    const laid = !ready ? null : kind === "grid" ? { corners: points, rows: typed("rows"), columns: typed("columns") } : laneGrid(points, { lanes: typed("lanes"), spacing: typed("spacing_m"), length: typed("length_m") || typed("spacing_m") });
    canvas.showCells(laid && [laid.rows, laid.columns].every((count) => count >= 1 && count <= 50) ? cellLines(laid) : []);
    clearTimeout(waiting);
    if (ready && frameId) waiting = setTimeout(check, PAUSE_MS);
    else fill(checked);
  }

  /** What the corners would be flagged for, before anything is measured. */
  async function check() {
    const asked = editor.points.join(" ");
    let answer;
    try {
      answer = await post(`/v1/frames/${frameId}/grid`, grid());
    } catch (error) {
      if (!error.code) throw error;
      return fill(checked, h("p", { class: "note warn" }, error.message));
    }
    if (asked !== editor.points.join(" ")) return;
    fill(checked,
      answer.findings.map((finding) => h("p", { class: "note warn" }, h("strong", {}, finding.sentence), ` ${detailOf(finding, 0)} ${finding.action}`)),
      answer.point_u_m === undefined ? null : h("p", { class: "small muted" }, `Points are known to ${number(answer.point_u_m, 2)} m on the road, from the corners alone.`),
    );
  }

  function grid() {
    return { corners: editor.points, ...Object.fromEntries(SIZES[kind].map(([name]) => [name, numberOf(inputs[name], { integer: !name.endsWith("_m") })])) };
  }

  /** Start a kind; a new drawing starts empty, since what the campaign's region shows in this frame is another place. */
  function turn(chosen) {
    kind = chosen;
    tools.hidden = corners.hidden = kind === "set";
    for (const [name, each] of sizes) each.hidden = kind !== name;
    canvas.element.inert = kind === "set";
    editor.load(kind === "set" && before.length ? [{ name: "", points: before, closed: true }] : []);
    fill(note, kind !== "set" ? (place ? "" : "Drag a rectangle on the preview, or click on each corner.") : before.length ? "" : "The campaign has no region. Frames without their own are not measured.");
  }

  function take(text) {
    const points = text.trim().split(/\s+/).map((pair) => pair.split(",").map(Number));
    if (points.length >= 3 && points.every((point) => point.length === 2 && point.every(Number.isFinite))) editor.take([{ points }]);
  }

  return {
    element,
    /** Show a frame with the region that holds for it; one of the frame's own is offered first, else what is drawn stays. */
    show(frame, polygon, url = `/v1/frames/${frame.id}/preview.png`) {
      const drawn = kind !== "set" && String(editor.size) === String([frame.width_px, frame.height_px]) ? editor.points : [];
      before = polygon ?? [];
      frameId = frame.id;
      canvas.show({ url, width: frame.width_px, height: frame.height_px });
      begin(frame.roi_id && offered.includes("set") ? "set" : kind);
      if (kind !== "set" && drawn.length >= 3) editor.take([{ points: drawn }]);
    },
    /** Offer the kinds of a method. */
    offer(names) {
      for (const each of kinds.querySelectorAll("input")) each.parentElement.hidden = !names.includes(each.value);
      if (!names.includes(kind)) begin("drawn");
    },
    paint: (url) => canvas.picture.setAttribute("href", url),
    /** Begin with corners that were measured before, so that they can be moved. */
    take(points, grid = null) {
      const laid = grid?.lanes ?? grid;
      begin(grid?.lanes ? "lanes" : grid ? "grid" : "drawn");
      for (const [name] of SIZES[kind] ?? []) inputs[name].value = laid[name];
      editor.take([{ points: laid?.marked ?? laid?.corners ?? points }]);
    },
    /** `roi` or `grid` of the request; throws what is wrong with it. */
    read() {
      if (kind === "set") return {};
      const { points } = editor;
      if (points.length < 3) throw wrong("Draw the region first: three corners or more.");
      if (kind === "drawn") return { roi: { polygon: points } };
      if (points.length !== 4) throw wrong(`A surface has four corners; ${points.length} are drawn.`);
      return { grid: grid() };
    },
  };

  function begin(chosen) {
    turn(chosen);
    for (const each of kinds.querySelectorAll("input")) each.checked = each.value === kind;
  }
}
