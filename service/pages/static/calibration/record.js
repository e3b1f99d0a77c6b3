// Decisions, other versions of the campaign, and the inputs.

import { bars, filename, h, table } from "../dom.js";
import { counted, day, number, percent, quantity, tag, time, withUncertainty, words } from "../format.js";
import { inOrder } from "../groups.js";
import { choiceLabel, coefficientLabel, methodOf, roleLabel } from "../methods.js";
import { parameterFacts } from "../parameter.js";
import { empty } from "../states.js";

/** Per ISO value, every model that was fitted; null where the method fits one alone. */
export function drawModels({ diagnostics, method }) {
  if (!diagnostics.iso_fits) return null;
  const rows = diagnostics.iso_fits.flatMap(({ coefficient, models }) => {
    const best = Math.min(...models.map((model) => model.aicc ?? Infinity));
    return models.map((model, index) => ({ ...model, coefficient, best, first: index === 0 }));
  });
  const columns = [
    { head: "ISO", header: true, class: "number", cell: (row) => (row.first ? number(row.coefficient.iso, 6) : h("span", { class: "hidden" }, number(row.coefficient.iso, 6))) },
    { head: "Model", cell: (row) => h("span", { class: "nowrap" }, choiceLabel(method, "model", row.model), row.model === row.coefficient.model ? [" ", tag("reported", "live")] : null) },
    { head: "Parameters", cell: parameters },
    { head: "R²", class: "number", cell: (row) => number(row.r_squared, 5) },
    { head: "χ² / dof", class: "number", cell: (row) => (row.chi_squared === null || row.chi_squared === undefined || !row.dof ? "–" : `${number(row.chi_squared, 3)} / ${row.dof}`) },
    { head: "ΔAICc", class: "number", cell: (row) => (row.aicc === null || row.aicc === undefined ? "–" : number(row.aicc - row.best, 3)) },
    { head: "Largest leave-one-out error", class: "number", cell: (row) => errorOf(row.left_out_max_rel) },
    { head: "rms", class: "number", cell: (row) => errorOf(row.left_out_rms_rel) },
  ];
  return table(columns, rows, { caption: "Models of each ISO value", row: (each) => ({ class: each.first ? "group" : null }) });
}

/** "Reported: Proportional: N = K X", of each ISO value where they differ. */
export function reportedModel({ diagnostics, method }) {
  const names = (diagnostics.iso_fits ?? []).map(({ coefficient }) => choiceLabel(method, "model", coefficient.model));
  return `Reported: ${[...new Set(names)].join(", ")}`;
}

const PARAMETERS = { luminance_k: "K", offset_dn: "offset [DN]", slope_dn: "slope [DN]" };
const errorOf = (share) => (share === null || share === undefined ? "–" : percent(share));

function parameters(row) {
  return h(
    "span",
    { class: "parameters" },
    row.parameter_names.map((name, index) => h("span", { class: "nowrap" }, `${PARAMETERS[name] ?? words(name)} = ${withUncertainty(row.parameters[index], Math.sqrt(row.covariance[index][index]))}`)),
  );
}

/** A card of bars for each coefficient that has a budget; null where none has. */
export function drawBudget({ diagnostics }) {
  const fits = diagnostics.iso_fits ?? diagnostics.band_fits ?? [];
  const cards = fits.filter((fit) => fit.budget?.length).map(({ coefficient, budget }) => card(titleOf(coefficient), budget));
  return cards.length ? cards : null;
}

const titleOf = (coefficient) => (coefficient.iso === undefined ? `Band ${words(coefficient.band)}` : `ISO ${number(coefficient.iso, 6)}`);

function card(title, budget) {
  const rows = [...budget].sort((a, b) => b.u_rel - a.u_rel);
  const whole = Math.hypot(...rows.map((row) => row.u_rel));
  return h(
    "figure",
    { class: "card budget" },
    h("figcaption", {}, h("strong", {}, title), h("span", { class: "muted" }, ` together ${percent(whole)}`)),
    bars(rows.map((row) => ({ name: row.source, share: row.u_rel / rows[0].u_rel, said: percent(row.u_rel), more: row.kind === "A" ? "type A, from scatter" : "type B, from other information" }))),
  );
}

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
