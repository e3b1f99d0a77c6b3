// Points, decisions, other versions of the campaign, and the inputs.

import { parameterFacts } from "../campaign/parameters.js";
import { smallLink } from "../causes.js";
import { budgetBar, empty, filename, fill, h, may, segments, shorten, table } from "../dom.js";
import { WRITTEN, capital, counted, day, exposureTime, fixed, headOf, inOrder, number, percent, quantity, tag, time, titleOf, withUncertainty, words } from "../format.js";
import { choiceLabel, coefficientLabel, methodOf, roleLabel } from "../methods.js";

/** Per ISO value, every model that was fitted; null where the method fits one alone. */
export function drawModels({ diagnostics, method }) {
  if (!diagnostics.iso_fits) return null;
  const rows = diagnostics.iso_fits.flatMap(({ coefficient, models }) => {
    const best = Math.min(...models.map((model) => model.aicc ?? Infinity));
    return models.map((model, index) => ({ ...model, coefficient, best, first: index === 0 }));
  });
  const columns = [
    { head: "ISO", header: true, class: "number", cell: (row) => (row.first ? row.coefficient.iso : h("span", { class: "hidden" }, row.coefficient.iso)) },
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
  return h("span", { class: "parameters" },
    row.parameter_names.map((name, index) => h("span", { class: "nowrap" }, `${PARAMETERS[name] ?? words(name)} = ${withUncertainty(row.parameters[index], Math.sqrt(row.covariance[index][index]))}`)),
  );
}

/** What would lower a source, to which share of itself at best, and whether it takes frames. */
const LOWERED = { "f-number": ["Measure the true f-numbers", 0, true], "meter calibration": ["A meter with half the uncertainty", 0.5] };
const WORTH = 0.95;

/** A bar for the coefficient that is chosen; null where none has a budget. */
export function drawBudget(found) {
  const { diagnostics } = found;
  const fits = (diagnostics.iso_fits ?? diagnostics.band_fits ?? []).filter((fit) => fit.budget?.length);
  if (!fits.length) return null;
  const place = h("div", {});
  const show = (fit) => fill(place, budgetOf(fit, found));
  show(fits[0]);
  return h("div", { class: "card budget" }, fits.length > 1 ? segments("Budget of", fits.map((fit) => [fit, nameOfFit(fit.coefficient)]), fits[0], show) : null, place);
}

const nameOfFit = (coefficient) => (coefficient.iso === undefined ? `Band ${words(coefficient.band)}` : `ISO ${coefficient.iso}`);

function budgetOf({ budget, coefficient }, found) {
  const rows = budget.filter((row) => row.u_rel > 0).sort((a, b) => b.u_rel - a.u_rel);
  const whole = Math.hypot(...rows.map((row) => row.u_rel));
  const lowered = rows.map((row) => {
    const [title, left, frames] = LOWERED[row.source] ?? (row.kind === "A" ? ["Twice as many frames and readings", Math.SQRT1_2, true] : [`Half the uncertainty of ${row.source}`, 0.5]);
    return [title, Math.sqrt(whole ** 2 - (1 - left ** 2) * row.u_rel ** 2), frames && may("upload") ? smallLink("Add frames", `/campaigns/${found.campaign_id}`) : null];
  });
  for (const { f_number: f, luminance_k: k, luminance_k_standard_uncertainty: u } of coefficient.apertures ?? []) lowered.push([`Measure at f/${number(f, 3)} alone: its own K is used`, u / k, may("upload") ? smallLink("Measure", "/measurements/new") : null]);
  const worth = lowered.filter(([, to]) => to < WORTH * whole).sort((a, b) => a[1] - b[1]);
  return [
    h("p", {}, h("strong", {}, `u = ${percent(whole)}`), h("span", { class: "muted" }, ` k = 1${coefficient.expanded_uncertainty ? `; k = ${number(coefficient.coverage_factor, 3)} for 95 %` : ""}`)),
    budgetBar(rows.map((row) => ({ source: row.source, share: (row.u_rel / whole) ** 2, said: percent(row.u_rel) }))),
    worth.length ? h("ul", { class: "lower", "aria-label": "What would lower it, at best" }, worth.slice(0, 4).map(([title, to, way]) => h("li", {}, h("strong", {}, title), h("b", {}, `${percent(whole)} → ${percent(to)}`), h("span", {}, way)))) : null,
    h("details", { class: "more" }, h("summary", {}, "As a table"), table(BUDGET, budget, { caption: `Budget of ${nameOfFit(coefficient)}` })),
  ];
}

const BUDGET = [
  { head: "Source", header: true, cell: (row) => row.source },
  { head: "Type", cell: (row) => (row.kind === "A" ? "A, from scatter" : "B, from other information") },
  { head: "u", class: "number", cell: (row) => percent(row.u_rel) },
  { head: "Share of the variance", class: "number", cell: (row) => percent(row.variance_share) },
];

export function drawHistory(items) {
  if (!items.length) return empty("No decisions yet");
  return h("ol", { class: "todo" },
    items.map((each) => h("li", {},
      h("div", { class: "todo-head" }, h("span", {}, tag(each.act), " by ", h("strong", { title: each.by }, each.by_name ?? each.by)), time(each.at)),
      each.valid_from ? h("p", {}, `In force from ${day(each.valid_from)} ${each.valid_to ? `to ${day(each.valid_to)}` : "on"}`) : null,
      each.reason ? h("p", {}, each.reason) : null,
    )),
  );
}

export function drawSiblings(own, versions) {
  if (versions.length < 2) return empty("The only version of its campaign", "Exclude a point or select another model, and refit. The versions are then listed here.");
  const columns = [
    { head: "Version", header: true, cell: (row) => (row.id === own.id ? h("strong", { "aria-current": "true" }, `${row.version}, this one`) : h("a", { href: `/calibrations/${row.id}` }, `Version ${row.version}`)) },
    { head: "State", cell: (row) => tag(row.state) },
    { head: "Settings", cell: howOf },
    { head: own.coefficients[0] ? `${coefficientLabel(own.method, own.coefficients[0].name)} ± u` : "Coefficient", class: "number", cell: (row) => (row.coefficients[0] ? quantity(row.coefficients[0]) : "–") },
  ];
  return table(columns, versions, { caption: "Versions of this campaign" });
}

function howOf({ method, parameters }) {
  const left = parameters.exclude?.length ?? 0;
  return [choiceLabel(method, "model", parameters.model), left ? `${left} excluded` : ""].filter(Boolean).join(", ") || "default";
}

// `stilb` is stored; it is the version of the code that fits, which a release may leave as it is.
const SOFTWARE = { stilb: "fit code version", release: "stilb" };

export function drawMade(calibration) {
  const { inputs, software, parameters } = calibration;
  return h("div", { class: "made" },
    h("dl", { class: "facts card" },
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

const HIDDEN = new Set(["frame", "frame_id", "used", "left_out", "capture_id", "figure", "residual_rel"]);
const U = "standard_uncertainty";

/** `choice`: {chosen, choose(frameId, name, isChosen)}, the frames that are selected. */
export function drawPoints({ points, parameters, diagnostics }, choice) {
  if (!points.length) return empty("No points", "This version has no points.");
  const residual = points.some((point) => present(point.residual_rel)) ? residualColumn : null;
  const columns = [choosing(choice), frameColumn, verdictColumn(parameters.exclude ?? []), residual, ...(diagnostics.iso_fits ? CURVE : ownColumns(points))].filter(Boolean);
  const draw = (rows) => table(columns, rows, { caption: "Points of the fit", row: (point) => ({ class: choice.chosen.has(point.frame_id) ? "chosen" : point.used ? null : "out", "data-frame-id": point.frame_id }) });
  return shorten(inOrder(points, (point) => `${point.scene ?? ""} ${point.frame}`), draw, 12);
}

const frameColumn = { head: "Frame", header: true, class: "frame-name", cell: (point) => filename(point.frame) };
/** Of what somebody left out their reason alone: who it was stands with what the version was made from. */
const verdictColumn = (exclude) => ({
  head: "Status",
  class: "in-fit",
  cell: (point) => {
    if (point.used) return tag("used", "good");
    const why = exclude.find((each) => each.frame === point.frame)?.reason ?? point.left_out;
    return h("span", {}, tag("not used", "warn"), h("span", { class: "small why-out" }, why));
  },
});

const residualColumn = { head: "Residual", class: "number", cell: (point) => (present(point.residual_rel) ? `${point.residual_rel > 0 ? "+" : ""}${fixed(100 * point.residual_rel, 2)} %` : "–") };

const CURVE = [
  { head: "Scene", class: "nowrap", cell: (point) => point.scene },
  { head: "Exposure", cell: (point) => h("span", { class: "nowrap" }, `${exposureTime(point.exposure_time_s)}, f/${number(point.f_number, 3)}, ISO ${point.iso}`) },
  { head: "L meter", class: "number", cell: (point) => withUnit(point.luminance_cd_m2, "cd/m²") },
  { head: "X", class: "number", cell: (point) => number(point.rhs) },
  { head: "Signal above dark", class: "number", cell: (point) => withUnit(point.adjusted_signal_dn, "DN", 5) },
  { head: "L fit", class: "number", cell: (point) => withUnit(point.fitted_luminance_cd_m2, "cd/m²") },
];

const present = (value) => value !== null && value !== undefined;
const withUnit = (value, unit, digits = 4) => (present(value) ? [number(value, digits), h("span", { class: "unit" }, ` ${unit}`)] : "–");

/** A column for each figure that some point has; its uncertainty stands in it. */
function ownColumns(points) {
  const known = [...new Set(points.flatMap(Object.keys))].filter((name) => !HIDDEN.has(name) && points.some((point) => present(point[name])));
  const names = known.filter((name) => !name.includes(U));
  return names.map((name) => {
    const numeric = points.some((point) => typeof point[name] === "number");
    const u = known.find((each) => each.includes(U) && (each === (name.endsWith("_rel") ? name.replace(/_rel$/, `_${U}_rel`) : `${name}_${U}`) || (name === "value" && each === U)));
    return { head: titleOf(WRITTEN[name] ? [WRITTEN[name][0], ""] : headOf(name === "value" ? points[0].figure : name)), class: numeric ? "number" : null, cell: (point) => figure(name, point[name], point[u]) };
  });
}

/** i_sq_standard_uncertainty, gradient_standard_uncertainty_rel */

function figure(name, value, u) {
  if (!present(value)) return "–";
  if (WRITTEN[name]) return WRITTEN[name][1](value);
  const scale = /_(rel|share)$/.test(name) ? 100 : 1;
  if (present(u)) return withUncertainty(scale * value, scale * u);
  if (scale !== 1) return number(100 * value, 3);
  if (typeof value === "number") return number(value, name.endsWith("_dn") ? 5 : 4);
  if (Array.isArray(value)) return value.length ? String(value.length) : "none";
  return name === "band" ? words(value) : String(value);
}

function choosing({ chosen, choose }) {
  if (!may("calibrate")) return null;
  const box = ({ frame, frame_id: id }) => h("input", { type: "checkbox", "aria-label": `Choose ${frame}`, checked: chosen.has(id), onchange: (event) => choose(id, frame, event.target.checked) });
  return { head: h("span", { class: "hidden" }, "Select"), class: "pick", cell: (point) => (point.used ? box(point) : "") };
}
