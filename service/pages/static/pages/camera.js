import { all, get } from "../api.js";
import { act, byId, empty, fill, h, leave, load, may, shorten, table } from "../dom.js";
import { ago, day, groupBy, quantity, relative, tag, time, unit } from "../format.js";
import { coefficientLabel, headlineOf, holdsFor, inForce, labelOf, methodOf, named, readTolerance } from "../methods.js";
import { plot } from "../plots.js";
import { editCamera } from "./camera-edit.js";

const id = document.querySelector("main").dataset.cameraId;
const choice = byId("drift-of");
const tolerance = byId("drift-tolerance");

const STABILITY = { stable: "good", drifts: "bad", cannot_tell: "" };

if (may("calibrate")) fill(byId("edit-camera"), h("button", { type: "button", onclick: (event) => act(event.target, async () => (await editCamera(id)) && leave()) }, "Edit camera"));

const series = get(`/v1/series/coefficients?camera_id=${id}`);

load(byId("in-force"), () => series, ({ rows }) => {
  const held = inForce(rows);
  if (!held.length) return empty("Nothing is in force", "Published calibrations of this camera appear here.", h("a", { class: "button", href: "/campaigns" }, "Campaigns"));
  return h("div", { class: held.length > 1 ? "columns" : null }, held.map(versionCard));
});

load(byId("history"), () => get(`/v1/cameras/${id}/decisions`), ({ items }) => {
  if (!items.length) return empty("No decisions yet", "Versions that are made, published or revoked appear here.");
  const columns = [
    { head: "Time", cell: (each) => time(each.at) },
    { head: "Decision", header: true, cell: (each) => h("span", {}, tag(each.act), " ", h("a", { href: `/calibrations/${each.calibration_id}` }, `${labelOf(each.method)} version ${each.version}`)) },
    { head: "In force", cell: validity },
    { head: "Person", cell: (each) => h("span", { title: each.by }, each.by_name ?? each.by) },
    { head: "Reason", cell: (each) => each.reason ?? "" },
  ];
  return table(columns, items, { caption: "Decisions about this camera's versions", stack: true });
});

load(byId("drift"), () => series, ({ rows }) => {
  const names = [...new Map(rows.map((row) => [`${row.method}/${row.name}`, row])).values()];
  if (!names.length) {
    byId("drift-choice").hidden = true;
    return empty("No history yet", "The plot appears with the second published version.");
  }
  fill(choice, names.map((row) => h("option", { value: `${row.method}/${row.name}`, selected: row.name === headlineOf(row.method) }, `${coefficientLabel(row.method, row.name)}${row.unit === "1" ? "" : ` [${unit(row.unit)}]`} (${labelOf(row.method)})`)));
  choice.disabled = false;
  choice.addEventListener("change", drawDrift);
  tolerance.addEventListener("change", () => tolerance.reportValidity() && drawDrift());
  const place = h("div", { class: "plot", id: "drift-plot" });
  queueMicrotask(drawDrift);
  return place;
});

all("/v1/rigs").then((rigs) => {
  const mine = rigs.filter((rig) => rig.camera_ids.includes(id));
  byId("rigs-section").hidden = !mine.length;
  fill(byId("rigs"), mine.map((rig) => h("li", {}, h("a", { href: `/rigs/${rig.id}` }, rig.name), rig.camera_ids[0] === id ? ": the reference" : "")));
});

async function drawDrift() {
  const [method, name] = choice.value.split("/");
  byId("drift-unit").textContent = methodOf(method).tolerance_unit;
  plot(byId("drift-plot"), `/plots/cameras/${id}/drift?method=${method}&name=${encodeURIComponent(name)}`);
  await load(byId("drift-said"), () => get(`/v1/cameras/${id}/drift?method=${method}&tolerance=${readTolerance(method, tolerance.value)}`), ({ parameters }) => {
    const whole = parameters.filter((each) => each.name === name && each.f_number === undefined);
    const said = whole.length ? whole : parameters.filter((each) => each.name === name);
    // what hinders several is said once
    const lines = [...groupBy(said, (each) => (each.slope || each.recalibrate_by ? each : each.why)).values()];
    const words = said.length > 1 && lines.length === 1 ? h("p", { class: "small" }, said[0].why) : lines.length ? h("ul", { class: "plain small" }, lines.map(saidOf)) : null;
    return [words, parameters.some((each) => each.change || each.verdict !== "cannot_tell") ? verdicts(parameters, method) : null];
  });
}

function verdicts(parameters, method) {
  const columns = [
    { head: "Coefficient", header: true, cell: (row) => named(row, method) },
    { head: "Stability", cell: (row) => tag(row.verdict, STABILITY[row.verdict]) },
    { head: "Change", class: "number", cell: (row) => quantity(row.change) },
    { head: "Repeatability", class: "number", cell: (row) => quantity(row.scatter) },
    { head: "Repeats", class: "number", cell: (row) => String(row.determinations.length) },
    { head: "Explanation", class: "words", cell: (row) => row.said.replace(/^[a-z0-9_]+(?: at [^:]+)?: /, "") },
  ];
  return shorten(parameters, (rows) => table(columns, rows, { caption: "Stability of every coefficient", stack: true }), 6);
}

function saidOf([parameter, ...others]) {
  const where = holdsFor(parameter);
  return h("li", {},
    where ? h("strong", {}, `${where}${others.length ? ` and ${others.length} more` : ""}: `) : null,
    parameter.slope ? [quantity(parameter.slope), `: ${parameter.verdict.replace("_", " ")}`] : "",
    parameter.recalibrate_by ? [parameter.slope ? "; " : "", "recalibrate by ", h("strong", {}, day(parameter.recalibrate_by))] : parameter.why ? [parameter.slope ? "; " : "", parameter.why] : "",
  );
}

function versionCard(version) {
  const columns = [
    { head: "Coefficient", header: true, cell: (row) => named(row) },
    { head: "Value", class: "number", cell: quantity },
    { head: "u", class: "number wide-only", cell: (row) => relative(row.value, row.standard_uncertainty) },
    { head: "Flags", class: "wide-only", cell: (row) => row.flags.split(/[ ,;]+/).filter(Boolean).map((flag) => tag(flag, "warn")) },
  ].filter((column) => column.head !== "Flags" || version.flags.length);
  return h("article", { class: "version" },
    h("div", { class: "section-head" },
      h("h3", {}, labelOf(version.method), " ", h("a", { href: `/calibrations/${version.calibration_id}` }, `version ${version.version}`)),
      h("p", {}, `since ${day(version.valid_from)}, ${ago(version.valid_from)}${version.valid_to ? `; until ${day(version.valid_to)}` : ""}`),
    ),
    version.flags.length ? h("p", { class: "narrow-only" }, version.flags.map((flag) => [tag(flag, "warn"), " "])) : null,
    shorten(version.rows, (rows) => table(columns, rows, { caption: `${labelOf(version.method)} version ${version.version}` })),
    drawing(version),
  );
}

/** What the numbers alone do not show, such as falloff over the frame. */
function drawing({ method, version, calibration_id: id }) {
  const address = `/v1/calibrations/${id}/plot.svg`;
  const picture = h("img", { class: "own-plot", src: address, loading: "lazy", alt: `Plot of ${labelOf(method)} version ${version}` });
  const figure = h("figure", { class: "drawing" }, h("a", { href: address }, picture));
  picture.addEventListener("error", () => figure.remove());
  return figure;
}

const validity = ({ valid_from: from, valid_to: to }) => (from ? h("span", { class: "nowrap" }, `${day(from)} – ${to ? day(to) : "open"}`) : "");
