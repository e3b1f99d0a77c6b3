// Region of a measurement: as set before, drawn here, or a rectangle on the ground with cells.

import { Problem, post } from "../api.js";
import { RegionCanvas, RegionEditor } from "../campaign/canvas.js";
import { about, choices, decimal, field, numberOf, readNumber } from "../campaign/forms.js";
import { faultOf } from "../campaign/polygon.js";
import { fill, h, leave } from "../dom.js";
import { detailOf } from "../causes.js";
import { number } from "../format.js";
import { followJob } from "../live.js";
import { wrong } from "../states.js";
import { cellLines, laneGrid } from "./surface.js";

/** Measure and go there; `progress` tells how far it is. */
export async function measureOne(body, progress) {
  try {
    progress.textContent = "Asking…";
    const started = await post("/v1/measurements", body);
    const job = await followJob(started.id, (each) => (progress.textContent = each.state === "queued" ? "Queued…" : `Measuring, ${Math.round(100 * each.progress)} %`));
    if (job.state !== "succeeded") throw new Problem(job.error);
    await leave(`/measurements/${job.result.measurement_id}`);
  } finally {
    progress.textContent = "";
  }
}

const KINDS = [
  ["drawn", "New region", "A polygon for this measurement only; of several frames, the same in each."],
  ["set", "Existing region", "The region of each frame, else that of its campaign."],
  ["grid", "Surface with cells", "Four corners of a rectangle on the ground, in the order top left, top right, bottom right, bottom left. Returns L of each cell and the uniformity."],
  ["lanes", "Lane grid", "Lanes between two luminaires with the points of EN 13201-3: four road points, the first two along the lanes, around all lanes."],
];

const PAUSE_MS = 250;

/** `place(canvas)`: where the canvas goes, if not into the part itself; `kinds`: those offered. */
export function regionPart({ place = null, kinds: offered = KINDS.map(([name]) => name) } = {}) {
  const editor = new RegionEditor();
  const canvas = new RegionCanvas(editor);
  let kind = "drawn";
  let before = [];
  let frameId;
  let waiting;
  const rows = h("input", { type: "number", min: 1, max: 50, value: 3 });
  const columns = h("input", { type: "number", min: 1, max: 50, value: 5 });
  const cells = h("div", { class: "fields" }, field("Rows of cells", rows, null, about("NewGrid", "rows")), field("Columns of cells", columns, null, about("NewGrid", "columns")));
  const [lanes, width, spacing, length] = [h("input", { type: "number", min: 1, max: 16, value: 2 }), decimal({ value: "3.5" }), decimal({ value: "30" }), decimal()];
  const road = h("div", { class: "fields" }, field("Lanes", lanes, null, about("NewGrid", "lanes")), field("Lane width [m]", width, null, about("NewGrid", "lane_width_m")), field("Spacing of luminaires [m]", spacing, null, about("NewGrid", "spacing_m")), field("Length of the rectangle [m]", length, "Empty: the spacing.", about("NewGrid", "length_m")));
  const button = (text, onclick) => h("button", { type: "button", onclick }, text);
  const tools = h("div", { class: "roi-toolbar", role: "toolbar", "aria-label": "Drawing" }, button("Rectangle", () => editor.rectangle()), button("Redraw", () => editor.clear()), button("Undo", () => editor.undo()), button("Fit to view", () => canvas.fit()));
  const typed = h("input", { autocomplete: "off", spellcheck: "false", onchange: () => take(typed.value) });
  const corners = field("Corners", typed, "x,y pairs in pixels, separated by blanks, from the top left of the image.", about("NewRoi", "polygon"));
  const note = h("p", { class: "hint" });
  const checked = h("div", { class: "region-checked", "aria-live": "polite" });
  const drawing = h("div", { class: "region-drawing" }, place ? null : canvas.element, tools, corners, cells, road, checked);
  const kinds = h("div", { class: "choices", role: "radiogroup", "aria-label": "Region", hidden: offered.length < 2 }, choices("region", KINDS.filter(([name]) => offered.includes(name)), turn, kind));
  place?.(canvas);
  const element = h("div", { class: "region-part" }, kinds, note, drawing);
  editor.addEventListener("settled", () => (typed.value = editor.points.map((point) => point.join(",")).join(" ")));
  for (const event of ["change", "settled"]) editor.addEventListener(event, drawCells);
  for (const input of [rows, columns, lanes, width, spacing, length]) input.addEventListener("input", drawCells);
  turn(kind);

  /** The cells over the picture, as soon as there are four corners. */
  function drawCells() {
    const points = editor.points;
    const ready = ["grid", "lanes"].includes(kind) && points.length === 4 && !faultOf(points);
    const [down, across, side, far, whole] = [rows, columns, lanes, spacing, length.value.trim() ? length : spacing].map((input) => readNumber(input.value));
    const laid = !ready ? null : kind === "grid" ? { corners: points, rows: down, columns: across } : laneGrid(points, { lanes: side, spacing: far, length: whole });
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
    fill(
      checked,
      answer.findings.map((finding) => h("p", { class: "note warn" }, h("strong", {}, finding.sentence), ` ${detailOf(finding, 0)} ${finding.action}`)),
      answer.point_u_m === undefined ? null : h("p", { class: "small muted" }, `Points are known to ${number(answer.point_u_m, 2)} m on the road, from the corners alone.`),
    );
  }

  function grid() {
    const points = editor.points;
    if (kind === "lanes") return { corners: points, lanes: numberOf(lanes, { integer: true }), lane_width_m: numberOf(width), spacing_m: numberOf(spacing), length_m: numberOf(length) };
    return { corners: points, rows: numberOf(rows, { integer: true }), columns: numberOf(columns, { integer: true }) };
  }

  /** Start a kind; a new drawing starts empty, since what the campaign's region shows in this frame is another place. */
  function turn(chosen) {
    kind = chosen;
    tools.hidden = corners.hidden = kind === "set";
    cells.hidden = kind !== "grid";
    road.hidden = kind !== "lanes";
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
    show(frame, polygon, url = `/v1/frames/${frame.id}/preview.png`) {
      before = polygon ?? [];
      frameId = frame.id;
      canvas.show({ url, width: frame.width_px, height: frame.height_px });
      begin(frame.roi_id && offered.includes("set") ? "set" : kind);
    },
    /** Another picture of the same place. */
    paint: (url) => canvas.picture.setAttribute("href", url),
    /** Begin with corners that were measured before, so that they can be moved. */
    take(points, grid = null) {
      const { lanes: road = null } = grid ?? {};
      if (road) for (const [input, value] of [[lanes, road.lanes], [width, road.lane_width_m], [spacing, road.spacing_m], [length, road.length_m]]) input.value = value;
      else if (grid) for (const [input, value] of [[rows, grid.rows], [columns, grid.columns]]) input.value = value;
      begin(road ? "lanes" : grid ? "grid" : "drawn");
      editor.take([{ points: road?.marked ?? grid?.corners ?? points }]);
    },
    /** `roi` or `grid` of the request; throws what is wrong with it. */
    read() {
      if (kind === "set") return {};
      const { points } = editor;
      const fault = points.length < 3 ? "Draw the region first: three corners or more." : faultOf(points);
      if (fault) throw wrong(fault);
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
