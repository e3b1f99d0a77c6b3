// One version: loaded once, drawn part by part, and redrawn after each decision.

import { all, get, getOr } from "../api.js";
import { named } from "../coefficients.js";
import { byId, figure, fill, h, mark, may, shorten, table } from "../dom.js";
import { drawFindings } from "../causes.js";
import { counted, day, number, percent, quantity, relative, tag, time, withUncertainty, words } from "../format.js";
import { choiceLabel, labelOf, methodOf } from "../methods.js";
import { plot } from "../plots.js";
import { empty, failed, load } from "../states.js";
import { offerDecisions } from "./decide.js";
import { drawPoints } from "./points.js";
import { drawBudget, drawHistory, drawMade, drawModels, drawSiblings, reportedModel } from "./record.js";
import { fitAnew } from "./refit.js";

class Choice extends EventTarget {
  frames = new Map();
  calibration = null;

  /** From now on there is something to refit. */
  offer(calibration) {
    this.calibration = calibration;
    this.draw();
  }

  has(frameId) {
    return this.frames.has(frameId);
  }

  set(frameId, name, chosen) {
    if (chosen === this.has(frameId)) return;
    if (chosen) this.frames.set(frameId, name);
    else this.frames.delete(frameId);
    this.changed();
  }

  clear() {
    this.frames.clear();
    this.changed();
  }

  changed() {
    this.draw();
    this.dispatchEvent(new Event("change"));
  }

  draw() {
    const bar = byId("chosen");
    const count = this.frames.size;
    bar.hidden = !count || !may("calibrate");
    if (bar.hidden) return;
    const names = [...this.frames.values()];
    fill(
      bar,
      h("p", {}, h("strong", {}, `${counted(count, "frame")} selected`), h("span", { class: "muted names" }, ` ${names.slice(0, 3).join(", ")}${count > 3 ? "…" : ""}`)),
      h(
        "span",
        { class: "actions" },
        h("button", { type: "button", class: "quiet", onclick: () => this.clear() }, "Clear"),
        h("button", { type: "button", class: "primary", onclick: () => fitAnew(this.calibration, this.frames) }, "Exclude and refit…"),
      ),
    );
  }
}

/** Where the version stands, and what took its place if anything did: a row of facts. */
function drawStatus([calibration, successor]) {
  const { state, valid_from: from, valid_to: to, superseded_by: by } = calibration;
  const facts = [
    ["State", stillHolds(calibration) ? h("span", {}, tag(state), h("span", { class: "sub" }, `from ${day(to)} on; in force until then`)) : tag(state)],
    from ? ["In force", h("span", { class: "nowrap" }, `${day(from)} – ${to ? day(to) : "open"}`)] : null,
    by ? ["Replaced by", h("a", { href: `/calibrations/${by}` }, successor ? `version ${successor.version}` : "another version")] : null,
    calibration.revoked_reason ? ["Revoked because", calibration.revoked_reason] : null,
    ["Fitted", time(calibration.created_at)],
    ["Campaign", h("a", { href: `/campaigns/${calibration.campaign_id}` }, methodOf(calibration.method).reference === "meter" ? "frames and readings" : "its frames")],
    ["Certificate", certificates(calibration)],
  ];
  return h("dl", { class: "facts status card" }, facts.filter(Boolean).map((each) => figure(...each)));
}

/** What was issued, the original first; of a draft, what would be. */
function certificates({ id, certificates: issued = [] }) {
  const links = (query) => [h("a", { href: `/v1/calibrations/${id}/certificate.pdf${query}` }, "PDF"), " · ", h("a", { href: `/v1/calibrations/${id}/certificate.json${query}` }, "JSON")];
  if (!issued.length) return h("span", {}, links(""));
  return issued.map((each) => h("div", { title: each.number }, each.amendment ? `Amendment ${each.amendment}: ` : null, links(each.amendment ? `?amendment=${each.amendment}` : ""), h("span", { class: "sub" }, `${each.at_upgrade ? "issued at an upgrade" : "issued"} ${day(each.issued_at)}, ${each.approved_by ? `signed by ${each.approved_by.name}, ${each.approved_by.role}` : "not signed"}`)));
}

/** Of a superseded version: whether what is left of its time is now. */
function stillHolds({ state, valid_from: from, valid_to: to }) {
  const now = Date.now();
  return state === "superseded" && from && to && new Date(from) <= now && now < new Date(to);
}

function drawVerdict(calibration) {
  const [shown, behind] = calibration.diagnostics.iso_fits ? curves(calibration) : [null, coefficients(calibration)];
  const figures = keyFigures(calibration);
  return [shown, figures, figures ? h("details", { class: "fold" }, h("summary", {}, "All coefficients"), behind) : behind];
}

/** The few figures that the method chooses; what an uncertainty without its scale would promise is left out. */
function keyFigures({ key_figures: rows = [], uncertainty_scope: scope }) {
  if (!rows.length) return null;
  return h(
    "dl",
    { class: "key-figures" },
    rows.map((row) => {
      const stated = row.expanded_uncertainty !== undefined && scope !== "relative_only";
      return h(
        "div",
        {},
        h("dt", {}, h("span", {}, words(row.group)), h("span", { class: "muted" }, ` ${row.label}`), row.passed === undefined ? null : mark(row.passed ? "good" : "bad", row.passed ? "Passes" : "Fails")),
        h("dd", {}, quantity(row), h("small", {}, row.unit === "%" ? null : `u = ${relative(row.value, row.standard_uncertainty)}`, stated ? ` · U = ${number(row.expanded_uncertainty, 2)} (k = ${number(row.coverage_factor, 3)}, 95 %)` : null)),
      );
    }),
  );
}

/** One curve for each ISO value, against a tolerance. */
function curves({ method, diagnostics, coefficients: rows, parameters, uncertainty_scope: scope }) {
  const fits = diagnostics.iso_fits;
  const tolerance = percent(diagnostics.tolerance_rel);
  const failing = fits.filter((fit) => !fit.passed);
  const columns = [
    { head: "ISO", header: true, class: "number", cell: ({ coefficient }) => number(coefficient.iso, 6) },
    { head: "K", class: "number", cell: ({ coefficient: c }) => quantity({ value: c.luminance_k, standard_uncertainty: c.luminance_k_standard_uncertainty, unit: c.luminance_k_unit }) },
    { head: "Verdict", cell: (fit) => (fit.passed ? tag("pass") : tag("beyond tolerance", "bad")) },
    { head: "Largest residual", class: "number", cell: (fit) => percent(fit.largest_residual_rel) },
    { head: "u(K)", class: "number", cell: ({ coefficient: c }) => relative(c.luminance_k, c.luminance_k_standard_uncertainty) },
    { head: "U, 95 %", class: "number", cell: ({ coefficient: c }) => expanded(c, scope) },
    { head: "Dark signal", class: "number", cell: ({ coefficient: c }) => h("span", {}, withUncertainty(c.dark_signal_dn, c.dark_signal_standard_uncertainty_dn), h("span", { class: "unit" }, " DN")) },
    { head: "Flags", class: "wide-only", cell: ({ coefficient }) => flagsOf(rows.find((row) => row.iso === coefficient.iso)) },
  ];
  const note = failing.length
    ? h("p", { class: "note bad" }, h("strong", {}, `${failing.length} of ${fits.length} ISO values exceed the tolerance of ${tolerance}. `), "Check the residuals. Do not exclude a point without a reason.")
    : h("p", { class: "note good" }, h("strong", {}, `Passes${["", "", " at both ISO values"][fits.length] ?? ` at all ${fits.length} ISO values`}. `), `The largest residual is ${percent(Math.max(...fits.map((fit) => fit.largest_residual_rel)))} of L; the tolerance is ${tolerance}.`);
  return [[note, conditions(diagnostics, parameters, method)], [table(columns, fits, { caption: "K of each ISO value" }), apertures(fits, scope)]];
}

/** The light that K holds for, and the rule of the verdict, as far as the campaign states them. */
function conditions({ spectral, iso_fits: fits }, { acceptance }, method) {
  const said = [
    spectral ? `Lamp: ${spectral.lamp}. Camera response: ${spectral.camera_response}${spectral.f1_prime === undefined ? "" : `, f₁′ ${percent(spectral.f1_prime)}`}.` : null,
    acceptance ? `Decision rule: ${choiceLabel(method, "acceptance", acceptance)}; ${fits.some((fit) => fit.expanded_u_rel === undefined) ? "U of K is unknown, because K is relative only" : `U of K up to ${percent(Math.max(...fits.map((fit) => fit.expanded_u_rel)))}, beyond the tolerance with a probability of up to ${percent(Math.max(...fits.map((fit) => fit.beyond_tolerance_risk)))}`}.` : null,
  ].filter(Boolean);
  return said.length ? h("p", { class: "small muted" }, said.join(" ")) : null;
}

/** U of a K with its coverage factor; what is relative only has none. */
function expanded(row, scope) {
  if (scope === "relative_only") return tag("relative only", "warn");
  return h("span", { title: `coverage factor ${number(row.coverage_factor, 3)}` }, number(row.expanded_uncertainty, 2), h("span", { class: "unit" }, ` k = ${number(row.coverage_factor, 3)}`));
}

/** K at the f-numbers of the calibration; a version from before they were fitted has none. */
function apertures(fits, scope) {
  const rows = fits.flatMap(({ coefficient: c }) => (c.apertures ?? []).map((aperture) => ({ ...aperture, c })));
  if (!rows.length) return null;
  const columns = [
    { head: "ISO", header: true, class: "number", cell: ({ c }) => number(c.iso, 6) },
    { head: "f-number", class: "number", cell: (row) => `f/${number(row.f_number, 3)}` },
    { head: "K", class: "number", cell: (row) => quantity({ value: row.luminance_k, standard_uncertainty: row.luminance_k_standard_uncertainty, unit: row.c.luminance_k_unit }) },
    { head: "u(K)", class: "number", cell: (row) => relative(row.luminance_k, row.luminance_k_standard_uncertainty) },
    { head: "U, 95 %", class: "number wide-only", cell: (row) => expanded(row, scope) },
    { head: "From K of the ISO", class: "number", cell: (row) => percent(row.luminance_k / row.c.luminance_k - 1) },
    { head: "Scenes", class: "number wide-only", cell: (row) => row.scenes },
  ];
  const says = "K at each f-number, which measurements at it use";
  return h("div", {}, h("p", { class: "small muted" }, `${says}.`), shorten(rows, (some) => table(columns, some, { caption: says })));
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

function drawPlots(calibration, choice) {
  const places = [...document.querySelectorAll("[data-plot]")];
  const usable = new Set(calibration.points.filter((point) => point.used).map((point) => point.frame_id));
  const mark = (name, holds) => {
    for (const point of document.querySelectorAll(".point[data-frame-id]")) point.classList.toggle(name, holds(point.dataset.frameId));
  };
  const show = () => mark("chosen", (id) => choice.has(id));
  for (const place of places) {
    plot(place, `/plots/calibrations/${calibration.id}/${place.dataset.plot}`, show);
    place.addEventListener("pointerover", ({ target: { dataset } }) => mark("lit", (id) => id === dataset.frameId));
    if (!may("calibrate")) continue;
    place.addEventListener("click", ({ target: { dataset } }) => {
      if (usable.has(dataset.frameId)) choice.set(dataset.frameId, dataset.frame, !choice.has(dataset.frameId));
    });
  }
  choice.addEventListener("change", show);
}

const main = document.querySelector("main");
const { calibrationId: id, method } = main.dataset;
const choice = new Choice();

start();

async function start() {
  const calibration = get(`/v1/calibrations/${id}`);
  showStatus(calibration);
  load(byId("verdict"), () => calibration, drawVerdict);
  load(byId("flags"), async () => (await calibration).findings, drawFindings);
  load(byId("points"), () => calibration, (found) => drawPoints(found, choice));
  load(byId("made"), () => calibration, drawMade);
  try {
    const found = await calibration;
    show("models", drawModels(found));
    fill(byId("models-note"), reportedModel(found));
    show("budget", drawBudget(found));
    choice.offer(found);
    drawPlots(found, choice);
    if (byId("drawn")) drawOwnPlot();
  } catch (error) {
    // each region tells it
    if (!error.code) throw error;
  }
}

/** State, history and what can be decided: what a decision changes. */
function showStatus(calibration) {
  load(byId("version-status"), () => withSuccessor(calibration), drawStatus);
  load(
    byId("history"),
    async () => {
      const found = await calibration;
      return get(`/v1/cameras/${found.camera_id}/decisions`);
    },
    ({ items }) => drawHistory(items.filter((each) => each.calibration_id === id)),
  );
  load(
    byId("siblings"),
    async () => {
      const found = await calibration;
      return [found, await all(`/v1/campaigns/${found.campaign_id}/calibrations`)];
    },
    ([found, versions]) => drawSiblings(found, versions),
  );
  calibration.then(
    (found) => offerDecisions(byId("decide"), found, (said) => (fill(byId("said"), said), showStatus(get(`/v1/calibrations/${id}`)))),
    () => {},
  );
}

async function withSuccessor(calibration) {
  const found = await calibration;
  return [found, found.superseded_by ? await getOr(`/v1/calibrations/${found.superseded_by}`, undefined) : undefined];
}

function show(name, drawn) {
  byId(`${name}-section`).hidden = !drawn;
  if (drawn) fill(byId(name), drawn);
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
