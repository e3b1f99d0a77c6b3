// The impact of publishing or revoking a version.

import { h, table } from "../dom.js";
import { fixed, number, quantity, tag, withUncertainty } from "../format.js";
import { named } from "../coefficients.js";

const METERS = {
  common: "Both depend on the same meter certificates, whose error cancels here.",
  unknown: "A reading has no certificate, so that no error is treated as common.",
};

export function drawImpact(impact, method) {
  return [
    h("p", { class: "note" }, h("strong", {}, impact.said), impact.meter_calibration && METERS[impact.meter_calibration] ? ` ${METERS[impact.meter_calibration]}` : null),
    impact.against?.calibration_id !== impact.calibration_id && impact.coefficients.length ? coefficients(impact.coefficients, method) : null,
    gains(impact),
    impact.measurements.length ? [h("h3", {}, `${impact.measurements.length} ${impact.measurements.length === 1 ? "measurement was" : "measurements were"} made with the version in force`), drawTouched(impact.measurements)] : null,
  ];
}

function coefficients(rows, method) {
  const columns = [
    { head: "Coefficient", header: true, cell: (row) => named(row, method) },
    { head: "In force", class: "number", cell: (row) => quantity(row.old) },
    { head: "This version", class: "number", cell: (row) => quantity(row.new) },
    { head: "Change", class: "number", cell: (row) => changeOf(row.change) },
    { head: "Change / u", class: "number", cell: (row) => (row.in_standard_uncertainties === undefined ? "–" : h("span", { class: row.in_standard_uncertainties >= 2 ? "significant" : null }, fixed(row.in_standard_uncertainties, 1))) },
  ];
  return table(columns, rows.slice(0, 40), { caption: "Changes of the coefficients" });
}

function gains({ isos_gained: plus, isos_lost: minus, flags_gained: raised, flags_lost: gone }) {
  const said = [
    plus.length ? `Gains ISO ${plus.map((iso) => number(iso, 6)).join(", ")}.` : null,
    minus.length ? `Loses ISO ${minus.map((iso) => number(iso, 6)).join(", ")}.` : null,
  ].filter(Boolean);
  const flags = (rows, kind) => [...new Set(rows.map((each) => each.flag))].map((flag) => tag(flag, kind));
  return [
    said.length ? h("p", {}, said.join(" ")) : null,
    raised.length ? h("p", {}, "Flags gained: ", flags(raised, "warn")) : null,
    gone.length ? h("p", {}, "Flags lost: ", flags(gone, "good")) : null,
  ];
}

/** Measurements that a version was used for, and what its successor would make of each. */
export function drawTouched(rows) {
  const columns = [
    { head: "Measurement", header: true, cell: (row) => h("a", { href: `/measurements/${row.measurement_id}` }, row.filename) },
    { head: "Change", class: "number", cell: (row) => (row.change ? changeOf(row.change) : "–") },
    { head: "", cell: (row) => row.why ?? (row.successor ? `by version ${row.successor.version}` : "") },
  ];
  return table(columns, rows.slice(0, 30), { caption: "Measurements made with it" });
}

function changeOf(change) {
  if (!change) return "–";
  const text = withUncertainty(change.value, change.standard_uncertainty);
  return h("span", { class: "nowrap" }, `${change.value > 0 ? "+" : ""}${text} %`);
}
