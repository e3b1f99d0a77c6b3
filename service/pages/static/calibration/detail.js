// The four models side by side, and the uncertainty budget.

import { bars } from "../bars.js";
import { h, table } from "../dom.js";
import { number, percent, tag, withUncertainty, words } from "../format.js";
import { choiceLabel } from "../methods.js";

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
