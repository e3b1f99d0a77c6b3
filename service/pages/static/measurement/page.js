// One measurement: its map, its figures, what it was measured with and what to know.

import { get } from "../api.js";
import { field } from "../ask.js";
import { drawFindings } from "../causes.js";
import { act, budgetBar, byId, empty, failed, figure, fill, h, load, may, prose, segments, svg, table, toggle } from "../dom.js";
import { capital, number, percent, quantity, relative, shortly, tag, time, typeset, unit, withUncertainty, words } from "../format.js";
import { labelOf, methodOf } from "../methods.js";
import { MapView, drawGrid, loadMap, scaleTools } from "./map.js";
import { measureOne, regionPart } from "./region.js";
import { regionOf, titleOf } from "./words.js";

/** What a measurement of another place of the same frame has in common with this one. */
const SAME = ["reflectance", "incidence_angle_deg", "index", "quantity", "allow"];

const MOST_BESIDE = 24;

/** The measurements of its night in the order in which they were taken; nothing where it is the only one. */
async function drawNight() {
  const { items } = await get(`/v1/measurements?campaign_id=${(await measurement).campaign_id}&limit=${MOST_BESIDE}`);
  const inTime = [...items].sort((a, b) => (a.taken_at ?? "").localeCompare(b.taken_at ?? ""));
  const link = (each) => h("a", { href: `/measurements/${each.id}`, "aria-current": each.id === id ? "page" : null, title: each.filename }, h("img", { src: `/v1/frames/${each.frame_id}/thumbnail.png`, alt: "", loading: "lazy" }), h("span", {}, each.taken_at?.slice(11, 16) ?? shortly(each.filename, 16)), h("span", { class: "muted" }, `${withUncertainty(each.mean.value, each.mean.standard_uncertainty).split(" ± ")[0]} ${each.mean.unit === "1" ? (each.index ? titleOf(each) : words(each.signal)) : unit(each.mean.unit)}`));
  return items.length > 1 ? h("nav", { class: "strip", "aria-label": "Measurements of the same night" }, inTime.map(link)) : null;
}

function regionTool(view, found, frame) {
  const part = regionPart({ place: (canvas) => view.cover(canvas.element), kinds: methodOf(found.method).measurement_options.includes("grid") ? ["drawn", "grid", "lanes"] : ["drawn"] });
  const preview = `/v1/frames/${frame.id}/preview.png`;
  let background = "map";
  const progress = h("span", { class: "muted", role: "status" });
  const button = toggle("Draw a region", turn);
  fill(byId("region-tools"), segments("Background", [["map", "Map"], ["picture", "Picture"]], background, (value) => part.paint((background = value) === "map" ? view.picture : preview)));
  fill(byId("region"), part.element, h("p", { class: "actions" }, h("button", { type: "button", class: "primary", onclick: (event) => act(event.target, measure) }, "Measure"), progress));
  view.onpaint = () => background === "map" && part.paint(view.picture);
  return button;

  function turn(on) {
    byId("region-section").hidden = !on;
    view.uncover(on);
    if (!on || button.dataset.begun) return;
    button.dataset.begun = "true";
    part.show({ ...frame, roi_id: null }, null, view.picture);
    part.take(found.region, found.grid);
  }

  function measure() {
    const { parameters } = found;
    const kept = Object.fromEntries(SAME.filter((name) => name in parameters).map((name) => [name, parameters[name]]));
    const frames = found.frame_ids ? { frame_ids: found.frame_ids } : { frame_id: found.frame_id };
    return measureOne({ ...frames, ...parameters.conditions, ...kept, ...part.read(), calibration_id: found.calibration.id, products: ["map"] }, progress);
  }
}

function isolineTool(view, id) {
  const layer = svg("g", { class: "map-isolines" });
  view.over.insertBefore(layer, view.probe.cross);
  const typed = h("input", { autocomplete: "off", spellcheck: "false", placeholder: "round ones", onchange: show });
  const told = h("div", { "aria-live": "polite" });
  const file = h("a", { class: "button", download: "" }, "GeoJSON");
  const button = toggle("Isolines", turn);
  fill(byId("isolines-tools"), file);
  fill(byId("isolines"), field("Levels", typed, "Values separated by commas, such as 0.5, 1, 2. Empty: round ones.", "/docs/measuring#isolines"), told);
  return button;

  function turn(on) {
    byId("isolines-section").hidden = !on;
    if (on) show();
    else layer.replaceChildren();
  }

  async function show() {
    const levels = typed.value.trim().split(/[\s,;]+/).filter(Boolean).join(",");
    const query = levels ? new URLSearchParams({ levels }).toString() : "";
    file.href = `/v1/measurements/${id}/isolines.geojson?${query}`;
    try {
      const found = await get(`/v1/measurements/${id}/isolines.geojson?coordinates=pixel&${query}`);
      if (button.ariaPressed === "true") draw(found);
    } catch (error) {
      layer.replaceChildren();
      fill(told, failed(error, show));
    }
  }

  function draw(found) {
    const size = view.map.width / 60;
    const paths = found.features.flatMap(({ geometry, properties }) => {
      const d = geometry.coordinates.map((line) => `M${line.join("L")}`).join("");
      if (!d) return [];
      const longest = geometry.coordinates.reduce((best, line) => (line.length > best.length ? line : best));
      const [x, y] = longest[Math.floor(longest.length / 2)];
      const label = svg("text", { x, y, "font-size": size, "stroke-width": size / 5 });
      label.append(number(properties.level, 3));
      return [svg("path", { class: "back", d }), svg("path", { d }), label];
    });
    layer.replaceChildren(...paths);
    fill(told, describe(found));
  }
}

function describe(found) {
  const drawn = found.features.filter(({ properties }) => properties.lines);
  const rings = found.features.reduce((sum, { properties }) => sum + properties.rings_left_out, 0);
  const scale = found.step_px > 1 ? `Of means over squares of ${found.step_px} px` : "Of single pixels";
  return [
    drawn.length ? h("ul", { class: "map-levels" }, drawn.map(level)) : h("p", { class: "muted" }, "No line at these levels."),
    h("ul", { class: "small muted map-notes" }, [
      `${scale}: finer detail is not drawn, nor what the lens does not resolve.`,
      rings ? `${rings} ring${rings === 1 ? "" : "s"} around a single square left out: noise, or a lamp.` : null,
      found.unknown_share ? `${number(100 * found.unknown_share, 2)} % of the squares are saturated: no line crosses them.` : null,
      ...found.notes,
    ].filter(Boolean).map((note) => h("li", {}, note))),
  ];
}

function level({ properties }) {
  const { level: value, unit: name, standard_uncertainty: u, place_u_px: place, too_dark: dark } = properties;
  const figure = `${u === undefined ? number(value, 3) : withUncertainty(value, u)} ${name === "1" ? "" : unit(name)}`.trim();
  const notes = [place === undefined ? null : `place ± ${number(place, 2)} px`, dark ? "not distinguished from zero" : null].filter(Boolean);
  return h("li", {}, figure, notes.length ? h("span", { class: "muted" }, ` (${notes.join("; ")})`) : null);
}

function drawFigures(found) {
  const apart = found.grid && found.region_origin !== "grid" ? " The cells are those of the surface, not of this region." : "";
  return [
    found.mean ? h("p", { class: apart ? "note warn" : "small muted" }, `Mean${found.median ? ", median" : ""}${found.min ? ", range" : ""}${found.illuminance ? ", illuminance" : ""}: of ${regionOf(found)}.${apart}`) : null,
    found.seen_from ? h("p", { class: "note" }, h("strong", {}, "Seen from above. "), found.seen_from_detail) : null,
    h("dl", { class: "figures" }, figures(found).map((each) => figure(...each))),
    found.index ? bands(found.index) : null,
    found.percentiles.length ? h("details", { class: "percentiles" }, h("summary", {}, "Percentiles of single pixels"), percentiles(found)) : null,
  ];
}

const range = (...ends) => h("span", { class: "nowrap" }, ends.map(({ value, standard_uncertainty: u }) => withUncertainty(value, u).split(" ± ")[0]).join(" – "));

function figures(found) {
  const { mean, grid } = found;
  const rows = [[found.index ? titleOf(found) : "Mean", quantity(mean), found.index ? "of the region’s mean reflectances" : `± u, here ${relative(mean.value, mean.standard_uncertainty)}${found.uncertainty_scope === "relative_only" ? ", relative only: no meter certificate" : ""}${found.coverage_factor ? `; U = k u with k = ${number(found.coverage_factor, 3)} for 95 %` : ""}${found.pixels ? `; ${number(found.pixels, 9)} pixels` : ""}`]];
  if (found.median) rows.push(["Median", quantity(found.median)]);
  if (found.min) rows.push(["Range of pixels", range(found.min, found.max), mean.unit === "1" ? "" : unit(mean.unit)]);
  if (grid) rows.push(["Overall uniformity U_o", quantity(found.u_o), `smallest / mean of the cells${found.seen_from ? ", seen from above" : ""}`], ["Range of cells", range(found.l_min_cd_m2, found.l_max_cd_m2), "cd/m²"]);
  if (found.u_l) rows.push(["Longitudinal uniformity U_l, worst row", quantity(found.u_l.reduce((worst, each) => (each.value < worst.value ? each : worst)))]);
  if (found.illuminance) rows.push(["Illuminance π L / ρ", quantity(found.illuminance)]);
  if (found.saturated_share) rows.push(["Saturated", percent(found.saturated_share), "of the region’s samples"]);
  if (found.reflected) rows.push(...reflected(found.reflected));
  if (found.place?.transform) rows.push(["Place of the map, worst corner", `± ${number(found.place.u_corner_m, 2)} m`, `${number(found.place.height_above_ground_m, 4)} m above level ground; ± ${number(found.place.u_centre_m, 2)} m in the centre. ${found.place.detail}`]);
  else if (found.place) rows.push(["Place of the map", "–", found.place.detail]);
  for (const each of found.alignment ?? []) rows.push([`Alignment of ${words(each.band)}`, `${number(each.residual_px, 2)} px`, ALIGNED[each.by](each)]);
  return rows;
}

const patches = (row) => `${row.patches} of ${row.tried} patches agree`;
const ALIGNED = {
  lens_data: (row) => `assumed, by lens data alone: ${patches(row)}`,
  lens_data_and_correlation: (row) => `left after a correction by ${number(Math.hypot(...row.shift_px), 3)} px; ${patches(row)}`,
  correlation: (row) => `left, by correlation alone; ${patches(row)}`,
};

const BASES = { levelled: "converted to a level surface", horizontal: "on a level surface, by the camera", compensated: "as the camera compensated it", oriented: "as the sensor was oriented" };
const sunshine = (row) => {
  const other = row.i_ss_oriented !== undefined && row.i_ss_basis !== "oriented" ? `, ${number(row.i_ss_oriented, 4)} as the sensor was oriented` : "";
  return `sunshine ${number(row.i_ss, 4)} ${BASES[row.i_ss_basis] ?? ""}${other}`;
};

function reflected(row) {
  return [
    ["Sensor signal", number(row.i_sq, 4), row.i_ss === undefined ? "without the sunshine sensor" : sunshine(row)],
    ["K of the band", number(row.reflectance_k, 4), row.incidence_angle_deg ? `surface tilted by ${number(row.incidence_angle_deg, 3)}°` : "surface normal to the light"],
    ["Outside 0 to 1", percent(row.below_zero_share + row.above_one_share), "of the region’s pixels"],
  ];
}

function bands({ bands: rows }) {
  const columns = [
    { head: "Band", header: true, cell: (row) => words(row.band) },
    { head: "Reflectance", class: "number", cell: (row) => quantity(row.reflectance) },
    { head: "K", class: "number", cell: (row) => number(row.reflectance_k) },
    { head: "Sensor", class: "number", cell: (row) => number(row.i_sq) },
    { head: "Sunshine", class: "number", cell: (row) => (row.i_ss === undefined ? "–" : number(row.i_ss)) },
  ];
  return h("div", { class: "bands" }, table(columns, rows, { caption: "Bands of the index" }));
}

function percentiles(found) {
  const rows = [
    ["smallest", found.min],
    ...found.percentiles.filter((row) => row.percent < 50).map(told),
    ["50 %", found.median],
    ...found.percentiles.filter((row) => row.percent > 50).map(told),
    ["largest", found.max],
  ];
  return table([{ head: "Percentile", header: true, cell: ([name]) => name }, { head: "Value", class: "number", cell: ([, value]) => quantity(value) }], rows, { caption: "Percentiles of single pixels" });
}

const told = (row) => [`${row.percent} %`, row.luminance ?? row.reflectance];

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
load(byId("night"), drawNight, (drawn) => drawn);
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
    empty("No map", "The values are those of the region. Remeasure with a map to read every pixel.", may("upload") ? h("a", { class: "button", href: `/measurements/new?again=${found.id}` }, "Remeasure") : null),
  ];
}

function offer(found) {
  fill(byId("go-on"),
    found.seen_from ? h("a", { class: "button", href: `/v1/measurements/${id}/report.pdf` }, "Report (PDF)") : null,
    found.grid?.lanes && may("calibrate") ? h("a", { class: "button", href: `/roads?from=${found.id}` }, "Evaluate as a road") : null,
    h("a", { class: "button", href: `/measurements?camera_id=${found.camera_id}&compare=${found.id}` }, "Compare with…"),
    may("upload") ? h("a", { class: "button", href: `/measurements/new?again=${found.id}` }, "Remeasure") : null,
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
  return h("div", { class: "card" },
    h("p", {}, h("a", { href: `/calibrations/${calibration.id}` }, `${labelOf(method)} version ${calibration.version}`), " ", tag(calibration.state)),
    h("p", { class: "small muted" }, typeset(calibration.why)),
    h("dl", { class: "facts small" }, h("dt", {}, "Signal"), h("dd", {}, words(signal)), h("dt", {}, "Vignetting correction"), h("dd", {}, lens), corrections.map(drawCorrection)),
  );
}

function drawBetter({ to_do_better: sentences, findings }) {
  const others = sentences.filter((each) => findings.every(({ action }) => action !== each));
  return others.length ? h("ul", { class: "better" }, others.map((each) => h("li", {}, prose(each)))) : h("p", { class: "muted" }, "No suggestions beside those of the flags.");
}

/** An error of the field: its factor or what was subtracted, and why. */
function drawCorrection({ source, factor, offset_cd_m2: offset, basis }) {
  const made = factor === 1 && !offset ? "" : `${[factor === 1 ? "" : `× ${number(factor, 4)}`, offset ? `− ${number(offset, 3)} cd/m²` : ""].filter(Boolean).join(" ")}: `;
  return [h("dt", {}, capital(words(source))), h("dd", {}, typeset(`${made}${basis}`))];
}

function drawBudget({ budget, mean }) {
  const rows = budget.filter((row) => row.variance_share > 0).sort((a, b) => b.variance_share - a.variance_share);
  if (!rows.length) return h("p", { class: "muted" }, "No budget is stored for this value.");
  const ofRow = (row) => row.standard_uncertainty_cd_m2 ?? row.standard_uncertainty;
  return h("div", { class: "card" },
    budgetBar(rows.map((row) => ({ source: row.source, share: row.variance_share, said: mean.value ? percent(ofRow(row) / Math.abs(mean.value)) : number(ofRow(row), 2) }))),
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
