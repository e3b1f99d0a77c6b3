// Region of a measurement: as set before, drawn here, or a rectangle on the ground with cells.

import { fill, h } from "../dom.js";
import { choices, field } from "../campaign/forms.js";
import { RegionCanvas } from "../campaign/canvas.js";
import { RegionEditor } from "../campaign/editor.js";
import { numberOf, wrong } from "../campaign/numbers.js";
import { faultOf } from "../campaign/polygon.js";

const KINDS = [
  ["drawn", "New region", "A polygon for this measurement only; of several frames, the same in each."],
  ["set", "Existing region", "The region of each frame, else that of its campaign."],
  ["grid", "Surface with cells", "Four corners of a rectangle on the ground, in the order top left, top right, bottom right, bottom left. Returns L of each cell and the uniformity."],
];

export function regionPart() {
  const editor = new RegionEditor();
  const canvas = new RegionCanvas(editor);
  let kind = "drawn";
  let before = [];
  const rows = h("input", { type: "number", min: 1, max: 50, value: 3 });
  const columns = h("input", { type: "number", min: 1, max: 50, value: 5 });
  const cells = h("div", { class: "fields" }, field("Rows of cells", rows), field("Columns of cells", columns));
  const button = (text, onclick) => h("button", { type: "button", onclick }, text);
  const tools = h("div", { class: "roi-toolbar", role: "toolbar", "aria-label": "Drawing" }, button("Rectangle", () => editor.rectangle()), button("Redraw", () => editor.clear()), button("Undo", () => editor.undo()), button("Fit to view", () => canvas.fit()));
  const typed = h("input", { autocomplete: "off", spellcheck: "false", onchange: () => take(typed.value) });
  const corners = field("Corners", typed, "x,y pairs in pixels, separated by blanks, from the top left of the image.");
  const note = h("p", { class: "hint" });
  const drawing = h("div", { class: "region-drawing" }, canvas.element, tools, corners, cells);
  const kinds = h("div", { class: "choices", role: "radiogroup", "aria-label": "Region" }, choices("region", KINDS, turn, kind));
  const element = h("div", { class: "region-part" }, kinds, note, drawing);
  editor.addEventListener("settled", () => (typed.value = editor.points.map((point) => point.join(",")).join(" ")));
  turn(kind);

  /** Start a kind; a new drawing starts empty, since what the campaign's region shows in this frame is another place. */
  function turn(chosen) {
    kind = chosen;
    tools.hidden = corners.hidden = kind === "set";
    cells.hidden = kind !== "grid";
    canvas.element.inert = kind === "set";
    editor.load(kind === "set" && before.length ? [{ name: "", points: before, closed: true }] : []);
    fill(note, kind === "set" && !before.length ? "The campaign has no region. Frames without their own are not measured." : "");
  }

  function take(text) {
    const points = text.trim().split(/\s+/).map((pair) => pair.split(",").map(Number));
    if (points.length >= 3 && points.every((point) => point.length === 2 && point.every(Number.isFinite))) editor.take([{ points }]);
  }

  return {
    element,
    /** Show a frame with the region that holds for it; one of the frame's own is offered first. */
    show(frame, polygon) {
      before = polygon ?? [];
      canvas.show({ url: `/v1/frames/${frame.id}/preview.png`, width: frame.width_px, height: frame.height_px });
      turn(frame.roi_id ? "set" : kind);
      for (const each of kinds.querySelectorAll("input")) each.checked = each.value === kind;
    },
    /** `roi` or `grid` of the request; throws what is wrong with it. */
    read() {
      if (kind === "set") return {};
      const { points } = editor;
      const fault = points.length < 3 ? "Draw the region first: three corners or more." : faultOf(points);
      if (fault) throw wrong(fault);
      if (kind === "drawn") return { roi: { polygon: points } };
      if (points.length !== 4) throw wrong(`A surface has four corners; ${points.length} are drawn.`);
      return { grid: { corners: points, rows: numberOf(rows, { integer: true }), columns: numberOf(columns, { integer: true }) } };
    },
  };
}
