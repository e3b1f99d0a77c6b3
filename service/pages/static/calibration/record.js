// Decisions, other versions of the campaign, and the inputs.

import { budgetBar, filename, fill, h, table } from "../dom.js";
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
  return h(
    "span",
    { class: "parameters" },
    row.parameter_names.map((name, index) => h("span", { class: "nowrap" }, `${PARAMETERS[name] ?? words(name)} = ${withUncertainty(row.parameters[index], Math.sqrt(row.covariance[index][index]))}`)),
  );
}

/** What would lower a source, and to which share of itself at best. */
const LOWERED = { "f-number": ["Measure the true f-numbers", 0], "meter calibration": ["A meter with half the uncertainty", 0.5] };
const WORTH = 0.95;

/** A bar for the coefficient that is chosen; null where none has a budget. */
export function drawBudget({ diagnostics }) {
  const fits = (diagnostics.iso_fits ?? diagnostics.band_fits ?? []).filter((fit) => fit.budget?.length);
  if (!fits.length) return null;
  const place = h("div", {});
  const buttons = fits.map((fit) => h("button", { type: "button", onclick: () => show(fit) }, titleOf(fit.coefficient)));
  const show = (shown) => {
    fits.forEach((fit, n) => buttons[n].setAttribute("aria-pressed", String(fit === shown)));
    fill(place, budgetOf(shown));
  };
  show(fits[0]);
  return h("div", { class: "card budget" }, fits.length > 1 ? h("div", { class: "segments", role: "group", "aria-label": "Budget of" }, buttons) : null, place);
}

const titleOf = (coefficient) => (coefficient.iso === undefined ? `Band ${words(coefficient.band)}` : `ISO ${coefficient.iso}`);

function budgetOf({ budget, coefficient }) {
  const rows = budget.filter((row) => row.u_rel > 0).sort((a, b) => b.u_rel - a.u_rel);
  const whole = Math.hypot(...rows.map((row) => row.u_rel));
  const lowered = rows.map((row) => {
    const [title, left] = LOWERED[row.source] ?? (row.kind === "A" ? ["Twice as many frames and readings", Math.SQRT1_2] : [`Half of ${row.source}`, 0.5]);
    return [title, Math.sqrt(whole ** 2 - (1 - left ** 2) * row.u_rel ** 2)];
  });
  for (const { f_number: f, luminance_k: k, luminance_k_standard_uncertainty: u } of coefficient.apertures ?? []) lowered.push([`Measure at f/${number(f, 3)} alone: its own K is used`, u / k]);
  const worth = lowered.filter(([, to]) => to < WORTH * whole).sort((a, b) => a[1] - b[1]);
  return [
    h("p", {}, h("strong", {}, `u = ${percent(whole)}`), h("span", { class: "muted" }, ` k = 1${coefficient.expanded_uncertainty ? `; k = ${number(coefficient.coverage_factor, 3)} for 95 %` : ""}`)),
    budgetBar(rows.map((row) => ({ source: row.source, share: (row.u_rel / whole) ** 2, said: percent(row.u_rel) }))),
    worth.length ? h("ul", { class: "lower", "aria-label": "What would lower it, at best" }, worth.slice(0, 4).map(([title, to]) => h("li", {}, h("strong", {}, title), h("b", {}, `${percent(whole)} → ${percent(to)}`)))) : null,
    h("details", { class: "more" }, h("summary", {}, "As a table"), table(BUDGET, budget, { caption: `Budget of ${titleOf(coefficient)}` })),
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
