// Decisions, other versions of the campaign, and the inputs.

import { filename, h, table } from "../dom.js";
import { counted, day, number, quantity, tag, time, words } from "../format.js";
import { inOrder } from "../groups.js";
import { choiceLabel, coefficientLabel, methodOf, roleLabel } from "../methods.js";
import { parameterFacts } from "../parameter.js";
import { empty } from "../states.js";

export function drawHistory(items) {
  if (!items.length) return empty("No decisions yet");
  return h(
    "ol",
    { class: "todo" },
    items.map((each) =>
      h(
        "li",
        {},
        h("div", { class: "todo-head" }, h("span", {}, tag(each.act), " by ", h("strong", { title: each.by }, each.by_name ?? each.by)), time(each.at)),
        each.valid_from ? h("p", {}, `In force from ${day(each.valid_from)} ${each.valid_to ? `to ${day(each.valid_to)}` : "on"}`) : null,
        each.reason ? h("p", {}, each.reason) : null,
      ),
    ),
  );
}

/** The other versions of the same campaign, to compare with. */
export function drawSiblings(own, versions) {
  if (versions.length < 2) return empty("The only version of its campaign", "Exclude a point or select another model, and refit. The versions are then listed here.");
  const columns = [
    { head: "Version", header: true, cell: (row) => (row.id === own.id ? h("strong", { "aria-current": "true" }, `${row.version}, this one`) : h("a", { href: `/calibrations/${row.id}` }, `Version ${row.version}`)) },
    { head: "State", cell: (row) => tag(row.state) },
    { head: "Settings", cell: howOf },
    { head: own.coefficients[0] ? coefficientLabel(own.method, own.coefficients[0].name) : "Coefficient", class: "number", cell: (row) => (row.coefficients[0] ? quantity(row.coefficients[0]) : "–") },
  ];
  return table(columns, versions, { caption: "Versions of this campaign" });
}

function howOf({ method, parameters }) {
  const left = parameters.exclude?.length ?? 0;
  return [choiceLabel(method, "model", parameters.model), left ? `${left} excluded` : ""].filter(Boolean).join(", ") || "default";
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

// `stilb` is stored; it is the version of the code that fits, which a release may leave as it is.
const SOFTWARE = { stilb: "fit code version", release: "stilb" };

export function drawMade(calibration) {
  const { inputs, software, parameters } = calibration;
  return h(
    "div",
    { class: "made" },
    h(
      "dl",
      { class: "facts card" },
      Object.entries(software).flatMap(([name, version]) => [h("dt", {}, SOFTWARE[name] ?? words(name)), h("dd", { class: "mono" }, String(version))]),
      h("dt", {}, "Content, SHA-256"),
      h("dd", { class: "mono small" }, calibration.content_sha256),
    ),
    h("details", { class: "card" }, h("summary", {}, "Parameters"), parameterFacts({ ...parameters, exclude: null }, methodOf(calibration.method).parameters)),
    excluded(parameters.exclude),
    h("details", { class: "card" }, h("summary", {}, `${counted(inputs.frames.length, "frame")} by content`), frames(inputs.frames)),
    inputs.readings?.length ? h("details", { class: "card" }, h("summary", {}, counted(inputs.readings.length, "reading")), readings(calibration)) : null,
  );
}

function excluded(rows) {
  if (!rows?.length) return null;
  const columns = [
    { head: "Excluded", header: true, cell: (row) => filename(row.frame) },
    { head: "Reason", cell: (row) => row.reason },
    { head: "By", cell: (row) => row.by },
  ];
  return h("div", {}, table(columns, rows, { caption: "Excluded frames" }));
}

function frames(rows) {
  const columns = [
    { head: "Frame", header: true, cell: (row) => row.frame },
    { head: "Role", cell: (row) => roleLabel(row.role) },
    { head: "Scene", cell: (row) => row.scene ?? "–" },
    { head: "SHA-256", cell: (row) => h("code", { title: row.sha256 }, `${row.sha256.slice(0, 16)}…`) },
  ];
  return table(columns, inOrder(rows, (row) => `${row.scene ?? ""} ${row.frame}`), { caption: "Frames" });
}

function readings({ inputs: { readings: rows }, diagnostics }) {
  if (rows[0].panel) return panel(rows, diagnostics.band_fits ?? []);
  const columns = [
    { head: "Scene", header: true, cell: (row) => row.scene },
    { head: "Quantity", cell: (row) => capital(row.quantity) },
    { head: "Value", class: "number", cell: (row) => `${number(row.value, 5)} ${row.quantity === "luminance" ? "cd/m²" : "lx"}` },
    { head: "Meter", cell: (row) => row.meter ?? "not recorded" },
  ];
  return table(columns, inOrder(rows, (row) => row.scene), { caption: "Readings" });
}

/** Every measurement of the panel; of several, those whose values the fit took. */
function panel(rows, fits) {
  const days = new Map(fits.map(({ coefficient: { band, panel_measured_on: on } }) => [band, on]));
  // without days there was one measurement, or what the files state
  const used = ({ band, measured_on: on, from_file: stated }) => (days.get(band) ? !stated && days.get(band).includes(on) : days.has(band) && (stated || !on));
  const columns = [
    { head: "Panel", header: true, cell: (row) => row.panel },
    { head: "Band", cell: (row) => words(row.band) },
    { head: "Measured on", cell: (row) => (row.from_file ? "stated by the files" : (row.measured_on ?? "–")) },
    { head: "Reflectance", class: "number", cell: (row) => quantity({ value: row.reflectance, standard_uncertainty: row.standard_uncertainty, unit: "1" }) },
    { head: "Used", cell: (row) => (used(row) ? "yes" : "no") },
  ];
  return table(columns, rows, { caption: "Reflectances of the panel" });
}
