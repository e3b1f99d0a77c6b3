// One measurement: its map, its figures, what it was measured with and what to know.

import { get } from "../api.js";
import { bars } from "../bars.js";
import { byId, fill, h, may, prose } from "../dom.js";
import { drawFindings } from "../flags.js";
import { number, percent, tag, time, typeset, words } from "../format.js";
import { labelOf } from "../methods.js";
import { empty, load } from "../states.js";
import { regionTool } from "./draw.js";
import { drawFigures } from "./figures.js";
import { drawGrid } from "./grid.js";
import { isolineTool } from "./isolines.js";
import { MapView } from "./map.js";
import { scaleTools } from "./tools.js";
import { loadMap } from "./values.js";
import { regionOf, titleOf } from "./words.js";

const { measurementId: id } = document.querySelector("main").dataset;
const measurement = get(`/v1/measurements/${id}`);

load(byId("figures"), () => measurement, (found) => {
  offer(found);
  warn(found);
  const grid = drawGrid(found);
  byId("grid-section").hidden = !grid;
  if (found.grid?.lanes) [byId("grid-title").textContent, byId("grid-note").textContent] = ["Lane grid", "In driving direction; value ± standard uncertainty"];
  const file = (name, text) => h("a", { class: "button quiet", href: `/v1/measurements/${id}/${name}`, download: "" }, text);
  if (grid) fill(byId("grid"), grid, h("p", { class: "actions" }, file("cells.csv", "CSV"), file("cells.geojson", "GeoJSON"), found.links.map_png ? file("map.png", "Picture") : null));
  return drawFigures(found);
});
load(byId("map"), drawableMap, (drawn) => drawn);
load(byId("with"), withFalloff, drawCalibration);
load(byId("budget"), () => measurement, drawBudget);
load(byId("better"), () => measurement, drawBetter);
load(byId("flags"), async () => (await measurement).findings, drawFindings);
load(byId("made"), () => measurement, drawRecord);

async function drawableMap() {
  const found = await measurement;
  if (!found.links.map_tif) return withoutMap(found);
  const frame = await get(found.links.frame);
  const values = await loadMap(found, frame);
  const view = new MapView(values, { region: found.region, grid: found.grid, name: `Map of ${found.filename}` });
  const tools = h("div", { class: "segments", role: "group", "aria-label": "Tools" }, isolineTool(view, id), may("upload") ? regionTool(view, found, frame) : null);
  fill(byId("map-tools"), scaleTools([view]), tools, h("a", { class: "button", href: found.links.map_tif, download: "" }, "TIFF"), h("a", { class: "button", href: found.links.stac, download: "" }, "STAC item"));
  return view.element;
}

function withoutMap(found) {
  return [
    h("img", { class: "map-preview", src: `${found.links.frame}/preview.png`, alt: `Preview of ${found.filename}` }),
    empty("No map", "The values are those of the region. Remeasure with a map to read every pixel.", may("upload") ? h("a", { class: "button", href: `/measurements/new?frame=${found.frame_id}` }, "Remeasure") : null),
  ];
}

function offer(found) {
  fill(
    byId("go-on"),
    found.seen_from ? h("a", { class: "button", href: `/v1/measurements/${id}/report.pdf` }, "Report (PDF)") : null,
    h("a", { class: "button", href: `/measurements?camera_id=${found.camera_id}&compare=${found.id}` }, "Compare with…"),
    may("upload") ? h("a", { class: "button", href: `/measurements/new?frame=${found.frame_id}` }, "Remeasure") : null,
  );
}

/** What makes the figure unfit for use stands above everything. */
function warn({ calibration }) {
  const said = {
    revoked: ["bad", "The calibration used has been revoked. Do not use these values; remeasure.", calibration.revoked_reason],
    superseded: ["warn", "The calibration used has been replaced. Remeasure if the values are still in use."],
    draft: ["warn", "The calibration used is a draft and has not been published."],
  }[calibration.state];
  if (said) fill(byId("warning"), h("p", { class: `note ${said[0]}` }, h("strong", {}, said[1]), said[2] ? ` Because: ${said[2]}` : null));
}

/** The measurement, and the vignetting version that it was corrected with, if it was. */
async function withFalloff() {
  const found = await measurement;
  const corrected = !["none", "file"].includes(found.vignetting);
  return [found, corrected ? await get(`/v1/calibrations/${found.vignetting}`) : undefined];
}

function drawCalibration([{ calibration, signal, vignetting, method, corrections }, falloff]) {
  const lens = falloff ? h("a", { href: `/calibrations/${falloff.id}` }, `vignetting version ${falloff.version}`) : { none: "nothing", file: "the correction stated in the file" }[vignetting];
  return h(
    "div",
    { class: "card" },
    h("p", {}, h("a", { href: `/calibrations/${calibration.id}` }, `${labelOf(method)} version ${calibration.version}`), " ", tag(calibration.state)),
    h("p", { class: "small muted" }, typeset(calibration.why)),
    h("dl", { class: "facts small" }, h("dt", {}, "Signal"), h("dd", {}, words(signal)), h("dt", {}, "Vignetting correction"), h("dd", {}, lens), corrections.map(drawCorrection)),
  );
}

/** What is not said beside the flags already. */
function drawBetter({ to_do_better: sentences, findings }) {
  const others = sentences.filter((each) => findings.every(({ action }) => action !== each));
  return others.length ? h("ul", { class: "better" }, others.map((each) => h("li", {}, prose(each)))) : h("p", { class: "muted" }, "No suggestions beside those of the flags.");
}

/** An error of the field: its factor or what was subtracted, and why. */
function drawCorrection({ source, factor, offset_cd_m2: offset, basis }) {
  const made = factor === 1 && !offset ? "" : `${[factor === 1 ? "" : `× ${number(factor, 4)}`, offset ? `− ${number(offset, 3)} cd/m²` : ""].filter(Boolean).join(" ")}: `;
  return [h("dt", {}, words(source)), h("dd", {}, typeset(`${made}${basis}`))];
}

function drawBudget({ budget, mean }) {
  const rows = budget.filter((row) => row.variance_share > 0).sort((a, b) => b.variance_share - a.variance_share);
  if (!rows.length) return h("p", { class: "muted" }, "No budget is stored for this value.");
  const ofRow = (row) => row.standard_uncertainty_cd_m2 ?? row.standard_uncertainty;
  const largest = ofRow(rows[0]);
  return h(
    "div",
    { class: "card" },
    bars(rows.map((row) => ({ name: row.source, share: ofRow(row) / largest, said: mean.value ? percent(ofRow(row) / Math.abs(mean.value)) : number(ofRow(row), 2), more: row.shared ? "the same error in every pixel" : "of this region only" }))),
    h("p", { class: "small muted budget-note" }, "Uncertainty of the mean. All errors except pixel noise are the same in every pixel of the frame; averaging over pixels does not reduce them."),
  );
}

function drawRecord(found) {
  const facts = [
    ["Quantity", titleOf(found)],
    ["Frame", [h("a", { href: `/campaigns/${found.campaign_id}` }, found.filename), found.frame_ids ? ` averaged with ${found.frame_ids.length - 1} more of the same scene` : null]],
    ["Taken", found.taken_at ? time(found.taken_at) : "not in the file"],
    ["Position", found.latitude_deg === undefined ? "not in the file" : `${number(found.latitude_deg, 9)}°, ${number(found.longitude_deg, 9)}°${found.altitude_m === undefined ? "" : `, ${number(found.altitude_m, 5)} m`}`],
    ["Region", `${found.region.length} corners: ${regionOf(found)}${found.pixels ? `; ${number(found.pixels, 9)} measured pixels` : ""}`],
    ["Measured", time(found.created_at)],
    ["Software", Object.entries(found.software).map(([name, version]) => `${name} ${version}`).join(", ")],
    ["Content, SHA-256", h("code", { class: "small" }, found.content_sha256)],
  ];
  return h("dl", { class: "facts card" }, facts.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
}
