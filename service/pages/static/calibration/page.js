// One version: loaded once, drawn part by part, and redrawn after each decision.

import { all, get, getOr } from "../api.js";
import { byId, empty, failed, fill, h, load, mark, may, shorten, table } from "../dom.js";
import { drawFindings } from "../causes.js";
import { counted, day, number, percent, quantity, relative, tag, time, withUncertainty, words } from "../format.js";
import { choiceLabel, labelOf, methodOf, named } from "../methods.js";
import { plot } from "../plots.js";
import { fitAnew, offerDecisions } from "./decide.js";
import { drawBudget, drawHistory, drawMade, drawModels, drawPoints, drawSiblings, reportedModel } from "./record.js";

/** Frames that were selected among the points, id to name, to be left out of another fit. */
const chosen = new Map();

function choose(frameId, name, isChosen) {
  if (isChosen) chosen.set(frameId, name);
  else chosen.delete(frameId);
  showChosen();
}

function showChosen() {
  for (const each of document.querySelectorAll("[data-frame-id]")) each.classList.toggle("chosen", chosen.has(each.dataset.frameId));
  for (const box of document.querySelectorAll("tr[data-frame-id] input")) box.checked = chosen.has(box.closest("tr").dataset.frameId);
  const names = [...chosen.values()];
  byId("chosen").hidden = !names.length;
  fill(byId("chosen"),
    h("p", {}, h("strong", {}, `${counted(names.length, "frame")} selected`), h("span", { class: "muted names" }, ` ${names.slice(0, 3).join(", ")}${names.length > 3 ? "…" : ""}`)),
    h("span", { class: "actions" },
      h("button", { type: "button", class: "quiet", onclick: () => (chosen.clear(), showChosen()) }, "Clear"),
      h("button", { type: "button", class: "primary", onclick: async () => fitAnew(await calibration, chosen) }, "Exclude and refit…"),
    ),
  );
}

/** Where the version stands, what took its place if anything did, and what it was made from: one line. */
function drawStatus([calibration, successor]) {
  const { state, valid_from: from, valid_to: to, superseded_by: by, points } = calibration;
  const facts = [
    [tag(state), stillHolds(calibration) ? ` from ${day(to)} on; in force until then` : null],
    from ? ["In force ", h("span", { class: "nowrap" }, `${day(from)} – ${to ? day(to) : "open"}`)] : null,
    by ? ["Replaced by ", h("a", { href: `/calibrations/${by}` }, successor ? `version ${successor.version}` : "another version")] : null,
    calibration.revoked_reason ? `Revoked because: ${calibration.revoked_reason}` : null,
    ["From ", h("a", { href: `/campaigns/${calibration.campaign_id}` }, methodOf(calibration.method).reference === "meter" ? "frames and readings" : "its frames")],
    points.length ? `${points.filter((point) => point.used).length} of ${counted(points.length, "point")} used` : null,
    ["Fitted ", time(calibration.created_at)],
    ...certificates(calibration),
  ];
  return h("ul", { class: "under" }, facts.filter(Boolean).map((each) => h("li", {}, each)));
}

/** What was issued, the original first; of a draft, what would be. */
function certificates({ id, certificates: issued = [] }) {
  const links = (query) => [h("a", { href: `/v1/calibrations/${id}/certificate.pdf${query}` }, "PDF"), " · ", h("a", { href: `/v1/calibrations/${id}/certificate.json${query}` }, "JSON")];
  if (!issued.length) return [["Preview of the certificate: ", links("")]];
  return issued.map((each) => [h("span", { title: each.number }, each.amendment ? `Amendment ${each.amendment}: ` : "Certificate: "), links(each.amendment ? `?amendment=${each.amendment}` : ""), `, ${each.at_upgrade ? "issued at an upgrade" : "issued"} ${day(each.issued_at)}, ${each.approved_by ? `signed by ${each.approved_by.name}, ${each.approved_by.role}` : "not signed"}`]);
}

/** Of a superseded version: whether what is left of its time is now. */
function stillHolds({ state, valid_from: from, valid_to: to }) {
  const now = Date.now();
  return state === "superseded" && from && to && new Date(from) <= now && now < new Date(to);
}

/** The few figures that the method chooses, with U where it is known, else with u. */
function keyFigures({ key_figures: rows = [], uncertainty_scope: scope }) {
  if (!rows.length) return null;
  return h("dl", { class: "key-figures" }, rows.map((row) => {
    const stated = row.expanded_uncertainty !== undefined;
    const u = row.unit === "%" ? null : `u = ${relative(row.value, row.standard_uncertainty)}`;
    return h("div", {},
      h("dt", {}, h("span", {}, words(row.group)), h("span", { class: "muted" }, ` ${row.label}`), row.passed === undefined ? null : mark(row.passed ? "good" : "bad", row.passed ? "Passes" : "Fails")),
      h("dd", {}, quantity(row, { expanded: stated }), h("small", {}, [u, stated ? `95 %, k = ${number(row.coverage_factor, 3)}` : scope === "relative_only" ? "relative only" : null].filter(Boolean).join(" · "))),
    );
  }));
}

function verdictOf({ iso_fits: fits, tolerance_rel: limit }, { acceptance: rule }) {
  const failing = fits.filter((fit) => !fit.passed);
  const largest = (name) => percent(Math.max(...fits.map((fit) => fit[name])));
  const known = fits.every((fit) => fit.expanded_u_rel !== undefined);
  const judged = [
    rule === "guarded" ? "" : `the largest residual is ${largest("largest_residual_rel")} of L`,
    (rule ?? "simple") === "simple" ? "" : known ? `U of K is up to ${largest("expanded_u_rel")}` : "U of K is unknown without a meter certificate",
    `the tolerance is ${percent(limit, 3)}`,
  ].filter(Boolean).join("; ");
  const said = `${judged.charAt(0).toUpperCase()}${judged.slice(1)}.`;
  return failing.length
    ? h("p", { class: "note bad" }, h("strong", {}, `Fails at ${failing.length} of ${fits.length} ISO values. `), said, " Do not exclude a point without a reason.")
    : h("p", { class: "note good" }, h("strong", {}, `Passes${["", "", " at both ISO values"][fits.length] ?? ` at all ${fits.length} ISO values`}. `), said);
}

/** K of each ISO value, and at the f-numbers of the calibration; a version from before they were fitted has none. */
function curves({ diagnostics: { iso_fits: fits }, coefficients: rows, uncertainty_scope: scope }) {
  const shown = fits.flatMap((fit) => [{ ...fit.coefficient, whole: fit.coefficient, fit }, ...(fit.coefficient.apertures ?? []).map((each) => ({ ...each, whole: fit.coefficient }))]);
  const columns = [
    { head: "ISO", header: true, class: "number", cell: ({ whole }) => whole.iso },
    { head: "f-number", class: "number", cell: (row) => (row.fit ? "all" : `f/${number(row.f_number, 3)}`) },
    { head: "K", class: "number", cell: (row) => quantity({ value: row.luminance_k, standard_uncertainty: row.luminance_k_standard_uncertainty, unit: row.whole.luminance_k_unit }) },
    { head: "u(K)", class: "number", cell: (row) => relative(row.luminance_k, row.luminance_k_standard_uncertainty) },
    { head: "U, 95 %", class: "number", cell: (row) => (scope === "relative_only" ? tag("relative only", "warn") : h("span", {}, number(row.expanded_uncertainty, 2), h("span", { class: "unit" }, ` k = ${number(row.coverage_factor, 3)}`))) },
    { head: "From K of the ISO", class: "number", cell: (row) => (row.fit ? "" : percent(row.luminance_k / row.whole.luminance_k - 1)) },
    { head: "Largest residual", class: "number wide-only", cell: ({ fit }) => (fit ? percent(fit.largest_residual_rel) : "") },
    { head: "Dark signal", class: "number wide-only", cell: ({ fit, whole }) => (fit ? [withUncertainty(whole.dark_signal_dn, whole.dark_signal_standard_uncertainty_dn), h("span", { class: "unit" }, " DN")] : "") },
    { head: "Flags", class: "wide-only", cell: ({ fit, whole }) => (fit ? flagsOf(rows.find((row) => row.iso === whole.iso)) : "") },
  ];
  return shorten(shown, (some) => table(columns, some, { caption: "K of each ISO value, and at each f-number, which measurements at it use" }));
}

/** The light that K holds for, and the rule of the verdict, as far as the campaign states them. */
function conditions({ spectral, iso_fits: fits }, { acceptance }, method) {
  const said = [
    spectral ? `Lamp: ${spectral.lamp}. Camera response: ${spectral.camera_response}${spectral.f1_prime === undefined ? "" : `, f₁′ ${percent(spectral.f1_prime)}`}.` : null,
    acceptance ? `Decision rule: ${choiceLabel(method, "acceptance", acceptance)}; ${fits.some((fit) => fit.expanded_u_rel === undefined) ? "U of K is unknown, because K is relative only" : `U of K up to ${percent(Math.max(...fits.map((fit) => fit.expanded_u_rel)))}, beyond the tolerance with a probability of up to ${percent(Math.max(...fits.map((fit) => fit.beyond_tolerance_risk)))}`}.` : null,
  ].filter(Boolean);
  return said.length ? h("p", { class: "small muted" }, said.join(" ")) : null;
}

function coefficients({ coefficients: rows, method }) {
  const columns = [
    { head: "Coefficient", header: true, cell: (row) => named(row, method) },
    { head: "Value", class: "number", cell: quantity },
    { head: "u", class: "number wide-only", cell: (row) => relative(row.value, row.standard_uncertainty) },
    { head: "Model", class: "nowrap wide-only", cell: (row) => choiceLabel(method, "model", row.model.split(":")[0]) },
    { head: "Flags", class: "wide-only", cell: flagsOf },
  ].filter((column) => column.head !== "Flags" || rows.some((row) => row.flags.length));
  return shorten(rows, (some) => table(columns, some, { caption: "Coefficients" }));
}

function flagsOf(row) {
  return row?.flags.length ? row.flags.map((flag) => tag(flag, "warn")) : h("span", { class: "muted" }, "none");
}

/** Those that are folded once they are opened: only then they have a width. */
function drawPlots({ id, points }) {
  const usable = new Set(points.filter((point) => point.used).map((point) => point.frame_id));
  const light = (frameId) => {
    for (const point of document.querySelectorAll(".point[data-frame-id]")) point.classList.toggle("lit", point.dataset.frameId === frameId);
  };
  for (const place of document.querySelectorAll("[data-plot]")) {
    const fold = place.closest("details");
    const draw = () => plot(place, `/plots/calibrations/${id}/${place.dataset.plot}`, showChosen);
    if (fold) fold.addEventListener("toggle", draw, { once: true });
    else draw();
    place.addEventListener("pointerover", ({ target: { dataset } }) => light(dataset.frameId));
    if (!may("calibrate")) continue;
    place.addEventListener("click", ({ target: { dataset } }) => {
      if (usable.has(dataset.frameId)) choose(dataset.frameId, dataset.frame, !chosen.has(dataset.frameId));
    });
  }
}

const main = document.querySelector("main");
const { calibrationId: id, method } = main.dataset;
const calibration = get(`/v1/calibrations/${id}`);

start();

async function start() {
  showStatus(calibration);
  load(byId("verdict"), () => calibration, (found) => [found.diagnostics.iso_fits ? [verdictOf(found.diagnostics, found.parameters), conditions(found.diagnostics, found.parameters, found.method)] : null, keyFigures(found)]);
  load(byId("coefficients"), () => calibration, (found) => (found.diagnostics.iso_fits ? curves(found) : coefficients(found)));
  load(byId("flags"), async () => (await calibration).findings, drawFindings);
  load(byId("points"), () => calibration, (found) => drawPoints(found, { chosen, choose }));
  load(byId("made"), () => calibration, drawMade);
  try {
    const found = await calibration;
    noteFolds(found);
    byId("coefficients-fold").open = !found.key_figures.length;
    // what fails is looked into
    byId("points-fold").open = found.diagnostics.iso_fits?.some((fit) => !fit.passed) ?? false;
    const [models, budget] = [drawModels(found), drawBudget(found)];
    byId("models-fold").hidden = !models;
    fill(byId("models"), models);
    byId("budget-section").hidden = !budget;
    fill(byId("budget"), budget);
    drawPlots(found);
    if (byId("drawn")) drawOwnPlot();
  } catch (error) {
    // each region tells it
    if (!error.code) throw error;
  }
}

function noteFolds({ coefficients: rows, points, findings, inputs, diagnostics, method }) {
  const notes = {
    coefficients: diagnostics.iso_fits ? "with U, dark signal and K at each f-number" : String(rows.length),
    points: `${points.length} rows, ${points.filter((point) => point.used).length} used`,
    models: reportedModel({ diagnostics, method }),
    flags: findings.length ? findings.map(({ code }) => tag(code, "warn")) : "no flags",
    made: `${[counted(inputs.frames.length, "frame"), inputs.readings?.length ? counted(inputs.readings.length, "reading") : null].filter(Boolean).join(", ")}, parameters, software`,
  };
  for (const [name, note] of Object.entries(notes)) fill(byId(`${name}-note`), note);
}

/** What a decision changes, of the version as it is `now`. */
function showStatus(now) {
  load(byId("version-status"), () => withSuccessor(now), drawStatus);
  load(byId("history"), async () => get(`/v1/cameras/${(await now).camera_id}/decisions`), ({ items }) => drawHistory(items.filter((each) => each.calibration_id === id)));
  load(byId("siblings"), async () => [await now, await all(`/v1/campaigns/${(await now).campaign_id}/calibrations`)], (found) => drawSiblings(...found));
  now.then(
    (found) => offerDecisions(found, (said) => (fill(byId("said"), said), showStatus(get(`/v1/calibrations/${id}`)))),
    () => {},
  );
}

async function withSuccessor(calibration) {
  const found = await calibration;
  return [found, found.superseded_by ? await getOr(`/v1/calibrations/${found.superseded_by}`, undefined) : undefined];
}

async function drawOwnPlot() {
  const place = byId("drawn");
  const address = `/v1/calibrations/${id}/plot.svg`;
  const picture = h("img", { class: "own-plot", src: address, alt: `Plot of this ${labelOf(method)} calibration` });
  picture.addEventListener("error", async () => {
    const answer = await getOr(address, undefined).catch((error) => error);
    fill(place, answer?.code ? failed(answer, drawOwnPlot) : empty("No plot", "This version has nothing to plot."));
  });
  fill(place, picture);
}
