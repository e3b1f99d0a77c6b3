// Publishing and revoking: the impact is shown before the decision.

import { all, get, getOr, post } from "../api.js";
import { ask } from "../ask.js";
import { editDetails } from "../campaign/details.js";
import { named } from "../coefficients.js";
import { fill, h, may, table, toast } from "../dom.js";
import { fixed, number, quantity, tag, withUncertainty } from "../format.js";
import { editCamera } from "../pages/camera-edit.js";
import { act, load } from "../states.js";
import { fitAnew } from "./refit.js";

const METERS = {
  common: "Both depend on the same meter certificates, whose error cancels here.",
  unknown: "A reading has no certificate, so that no error is treated as common.",
};

function drawImpact(impact, method) {
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
function drawTouched(rows) {
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

/** The field of the campaign that fills a gap of its certificate. */
const FIELD_OF_GAP = { customer_missing: "customer", place_missing: "place", conditions_missing: "conditions", date_missing: "started_at", recorder_missing: "recorder" };

/** Gaps that are filled on the pages of the organisation: with its keys, and in its details. */
const OF_ORGANISATION = new Set(["approver_missing", "author_missing", "laboratory_name_missing", "laboratory_address_missing"]);

/** Buttons for what this key may decide; `decided(said)` hears of it. */
export function offerDecisions(place, calibration, decided) {
  const button = (text, style, onclick) => h("button", { type: "button", class: style, onclick }, text);
  const revoked = calibration.state === "revoked";
  fill(
    place,
    may("calibrate") ? button("Refit…", null, () => fitAnew(calibration)) : null,
    may("publish") && !revoked ? button("Revoke…", "danger", () => revoke(calibration, decided)) : null,
    may("publish") && !revoked ? button(calibration.state === "draft" ? "Publish…" : "Publish again…", calibration.state === "draft" ? "primary" : null, (event) => publish(event.target, calibration, decided)) : null,
  );
}

async function publish(button, calibration, decided) {
  const found = await act(button, () => get(`/v1/calibrations/${calibration.id}`));
  if (!found) return;
  const suggested = found.suggested_validity ?? { valid_from: found.valid_from };
  const { signature } = await getOr(`/v1/campaigns/${calibration.campaign_id}/checklist`, {});
  const impact = h("div", { class: "impact", "aria-live": "polite" });
  const show = () => {
    const at = instant(document.getElementById("ask-valid_from").value);
    if (at) load(impact, () => get(`/v1/calibrations/${calibration.id}/impact?at=${encodeURIComponent(at)}`), (found) => [drawGaps(found.warnings, calibration, show), drawImpact(found, calibration.method)]);
  };
  const asked = ask({
    title: `Publish version ${calibration.version}`,
    body: [found.certificates?.length ? h("p", { class: "small muted" }, "Its certificate stays as it was issued. This publication issues an amendment beside it, with your reason.") : null, impact],
    fields: [
      { name: "valid_from", label: "In force from (UTC)", of: "NewPublication", type: "datetime-local", value: typed(suggested.valid_from) },
      { name: "valid_to", label: "Until (UTC)", of: "NewPublication", type: "datetime-local", value: typed(suggested.valid_to), required: false },
      { name: "reason", label: "Reason", of: "NewPublication", type: "textarea", value: signature ? `Checklist signed by ${signature.name}` : "" },
    ],
    submit: "Publish",
    action: ({ valid_from, valid_to, reason }) =>
      post(`/v1/calibrations/${calibration.id}/publish`, { valid_from: instant(valid_from), reason, ...(valid_to ? { valid_to: instant(valid_to) } : {}) }),
  });
  document.getElementById("ask-valid_from").addEventListener("change", show);
  show();
  const answer = await asked;
  if (!answer) return;
  toast(`Version ${answer.version} is published.`);
  decided(answer.warnings?.length ? h("div", { class: "note warn" }, h("p", {}, h("strong", {}, "Published. Items of ISO/IEC 17025, 7.8, that the certificate lacks:")), h("ul", {}, answer.warnings.map((gap) => h("li", {}, gap.message)))) : null);
}

/** What the certificate would lack, with the fields that are filled in at once. */
function drawGaps(gaps, calibration, again) {
  if (!gaps.length) return h("p", { class: "note good" }, "The certificate lacks nothing that ISO/IEC 17025, 7.8, asks for.");
  const only = gaps.map(({ code }) => FIELD_OF_GAP[code]).filter(Boolean);
  const fillIn = async (event) => act(event.target, async () => (await editDetails(await get(`/v1/campaigns/${calibration.campaign_id}`), { only })) && again());
  const lens = gaps.some(({ code }) => code === "lens_missing");
  return h(
    "div",
    { class: "note warn" },
    h("p", {}, h("strong", {}, "Before you publish: the certificate would lack")),
    h("ul", {}, gaps.map((gap) => h("li", {}, gap.message))),
    may("calibrate")
      ? h(
          "p",
          { class: "actions" },
          only.length ? h("button", { type: "button", onclick: fillIn }, "Fill in") : null,
          gaps.some(({ code }) => OF_ORGANISATION.has(code)) ? h("a", { class: "button quiet", href: "/organisation" }, "Open the organisation") : null,
          lens ? h("button", { type: "button", onclick: async (event) => act(event.target, async () => (await editCamera(calibration.camera_id)) && again()) }, "Register the lens") : null,
          h("a", { class: "button quiet", href: `/campaigns/${calibration.campaign_id}#checklist` }, "Open the campaign"),
        )
      : null,
  );
}

async function revoke(calibration, decided) {
  const touched = h("div", { class: "impact", "aria-live": "polite" });
  load(touched, () => all(`/v1/measurements?calibration_id=${calibration.id}`), (found) => [
    h("p", {}, "A revocation is permanent. The version is not replaced automatically: no version is in force in its period until another is published there."),
    h("p", {}, found.length ? h("strong", {}, `${found.length} ${found.length === 1 ? "measurement was" : "measurements were"} made with it. They are kept and flagged.`) : "No measurements were made with it."),
    found.length ? h("ul", { class: "plain small" }, found.slice(0, 6).map((each) => h("li", {}, each.filename)), found.length > 6 ? h("li", {}, `and ${found.length - 6} more`) : null) : null,
  ]);
  const answer = await ask({
    title: `Revoke version ${calibration.version}`,
    body: touched,
    fields: [{ name: "reason", label: "Reason", type: "textarea", of: "NewRevocation" }],
    submit: "Revoke permanently",
    danger: true,
    action: (values) => post(`/v1/calibrations/${calibration.id}/revoke`, values),
  });
  if (!answer) return;
  toast(`Version ${answer.version} is revoked.`);
  decided(answer.measurements.length ? h("div", { class: "note bad" }, h("p", {}, h("strong", {}, "Revoked. These measurements were made with it:")), drawTouched(answer.measurements)) : null);
}

const typed = (at) => at?.slice(0, 16) ?? "";
const instant = (text) => (text ? new Date(`${text}Z`).toISOString() : undefined);
