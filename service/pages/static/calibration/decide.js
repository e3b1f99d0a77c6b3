// Publishing and revoking: the impact is shown before the decision.

import { all, get, getOr, post, runJob } from "../api.js";
import { ask } from "../ask.js";
import { editDetails } from "../campaign/details.js";
import { parametersFold } from "../campaign/parameters.js";
import { causeFold, small, smallLink } from "../causes.js";
import { act, byId, fill, h, leave, load, may, table, toast } from "../dom.js";
import { fixed, quantity, tag, withUncertainty } from "../format.js";
import { methodOf, named } from "../methods.js";
import { statePerson } from "../organisation/person.js";
import { editCamera } from "../pages/camera-edit.js";

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
    { head: "In force ± u", class: "number", cell: (row) => quantity(row.old) },
    { head: "This version ± u", class: "number", cell: (row) => quantity(row.new) },
    { head: "Change", class: "number", cell: (row) => changeOf(row.change) },
    { head: "Change / u", class: "number", cell: (row) => (row.in_standard_uncertainties === undefined ? "–" : h("span", { class: row.in_standard_uncertainties >= 2 ? "significant" : null }, fixed(row.in_standard_uncertainties, 1))) },
  ];
  return table(columns, rows.slice(0, 40), { caption: "Changes of the coefficients" });
}

function gains({ isos_gained: plus, isos_lost: minus, flags_gained: raised, flags_lost: gone }) {
  const said = [
    plus.length ? `Gains ISO ${plus.map((iso) => iso).join(", ")}.` : null,
    minus.length ? `Loses ISO ${minus.map((iso) => iso).join(", ")}.` : null,
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
  return h("span", { class: "nowrap" }, `${change.value > 0 ? "+" : ""}${withUncertainty(change.value, change.standard_uncertainty)} %`);
}

/** The field of the campaign that fills a gap of its certificate, and how it is called. */
const FIELD_OF_GAP = { customer_missing: ["customer", "customer"], place_missing: ["place", "place"], conditions_missing: ["conditions", "conditions"], date_missing: ["started_at", "start"], recorder_missing: ["recorder", "recorder"] };

/** Gaps that are filled on the pages of the organisation: with its keys, and in its details. */
const OF_ORGANISATION = new Set(["approver_missing", "author_missing", "laboratory_name_missing", "laboratory_address_missing"]);

/** Without these a certificate is none that a laboratory signs: they stop the button. */
const NEEDED = new Set(["approver_missing", "customer_missing", "place_missing"]);

/** Buttons for what this key may decide, and before a draft is published what its certificate would lack; `decided(said)` hears of a decision. */
export function offerDecisions(calibration, decided) {
  const button = (text, style, onclick, more) => h("button", { type: "button", class: style, onclick, ...more }, text);
  const { state } = calibration;
  const [mayPublish, draft] = [may("publish") && state !== "revoked", state === "draft"];
  const publishing = button(draft ? "Publish…" : "Publish again…", draft ? "primary" : null, (event) => publish(event.target, calibration, decided), { disabled: draft });
  fill(byId("decide"),
    may("calibrate") ? button("Refit…", null, () => fitAnew(calibration)) : null,
    mayPublish ? button("Revoke…", "danger", () => revoke(calibration, decided)) : null,
    mayPublish ? publishing : null,
  );
  byId("lacking-section").hidden = !(mayPublish && draft);
  const show = () => load(byId("lacking"), () => get(`/v1/calibrations/${calibration.id}/impact`), ({ warnings }) => {
    publishing.disabled = warnings.some(({ code }) => NEEDED.has(code));
    return drawGaps(warnings, calibration, show);
  });
  if (mayPublish && draft) show();
}

async function publish(button, calibration, decided) {
  const found = await act(button, () => get(`/v1/calibrations/${calibration.id}`));
  if (!found) return;
  const suggested = found.suggested_validity ?? { valid_from: found.valid_from };
  const { signature } = await getOr(`/v1/campaigns/${calibration.campaign_id}/checklist`, {});
  const impact = h("div", { class: "impact", "aria-live": "polite" });
  const show = () => {
    const at = instant(document.getElementById("ask-valid_from").value);
    if (at) load(impact, () => get(`/v1/calibrations/${calibration.id}/impact?at=${encodeURIComponent(at)}`), (found) => [calibration.state === "draft" ? null : drawGaps(found.warnings, calibration, show), drawImpact(found, calibration.method)]);
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
    action: ({ valid_from, valid_to, reason }) => post(`/v1/calibrations/${calibration.id}/publish`, { valid_from: instant(valid_from), reason, ...(valid_to ? { valid_to: instant(valid_to) } : {}) }),
  });
  document.getElementById("ask-valid_from").addEventListener("change", show);
  show();
  const answer = await asked;
  if (!answer) return;
  toast(`Version ${answer.version} is published.`);
  decided(null);
}

/** What the certificate would lack, one line for each thing to do; `again` looks once more. */
function drawGaps(gaps, calibration, again) {
  if (!gaps.length) return h("p", { class: "note good" }, "The certificate lacks nothing that ISO/IEC 17025, 7.8, asks for.");
  const does = (action) => async (event) => act(event.target, async () => (await action()) && again());
  const fields = gaps.map(({ code }) => FIELD_OF_GAP[code]).filter(Boolean);
  const actionOf = (code) => {
    if (code === "approver_missing" && may("admin")) return small("State your name", does(async () => statePerson(await get("/v1/keys/own"))));
    if (OF_ORGANISATION.has(code)) return smallLink("Open the organisation", "/organisation");
    if (!may("calibrate")) return null;
    if (code === "lens_missing") return small("Register the lens", does(() => editCamera(calibration.camera_id)));
    return smallLink("Open the campaign", `/campaigns/${calibration.campaign_id}#checklist`);
  };
  const line = (title, codes, action) => {
    const needed = codes.some((code) => NEEDED.has(code));
    return { title, mark: needed ? "warn" : "wait", tag: needed ? tag("needed", "warn") : null, actions: [action].filter(Boolean) };
  };
  const campaign = does(async () => editDetails(await get(`/v1/campaigns/${calibration.campaign_id}`), { only: fields.map(([field]) => field) }));
  const lines = [
    fields.length ? line(`Not stated on the campaign: ${fields.map(([, name]) => name).join(", ")}`, gaps.map(({ code }) => code).filter((code) => FIELD_OF_GAP[code]), may("calibrate") ? small("Fill in", campaign) : null) : null,
    ...gaps.filter(({ code }) => !FIELD_OF_GAP[code]).map(({ code, message }) => line(message.replace(/\.$/, ""), [code], actionOf(code))),
  ];
  return causeFold(lines.filter(Boolean).sort((a, b) => (b.mark === "warn") - (a.mark === "warn")), 4);
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
  const { measurements, roads } = answer;
  const links = roads.map((each) => [h("a", { href: `/roads/${each.road_id}` }, each.name), ` (evaluation ${each.number}) `]);
  decided(measurements.length + roads.length ? h("div", { class: "note bad" }, measurements.length ? [h("p", {}, h("strong", {}, "Revoked. These measurements were made with it:")), drawTouched(measurements)] : null, roads.length ? h("p", {}, h("strong", {}, "Roads that were evaluated with it: "), links) : null) : null);
}

const typed = (at) => at?.slice(0, 16) ?? "";
const instant = (text) => (text ? new Date(`${text}Z`).toISOString() : undefined);

/** Ask how, fit, and go to the version that it gives. `chosen`: frames to leave out, id to name. */
export async function fitAnew(calibration, chosen = new Map()) {
  const former = calibration.parameters.exclude ?? [];
  const parameters = parametersFold(methodOf(calibration.method), calibration.camera_id, { former: calibration.parameters, open: !chosen.size });
  const keep = former.map((each, index) => ({ ...each, box: h("input", { type: "checkbox", id: `keep-${index}`, checked: true }) }));
  const said = h("p", { class: "hint", role: "status" });
  const made = await ask({
    title: chosen.size ? `Exclude ${chosen.size === 1 ? [...chosen.values()][0] : `${chosen.size} frames`} and refit` : "Refit",
    body: [
      h("p", { class: "muted" }, "This version does not change. The new one is a draft until it is published."),
      keep.length ? h("fieldset", {}, h("legend", {}, "Excluded so far; untick to include again"), keep.map(({ box, frame, reason }) => h("p", { class: "check" }, box, h("label", { for: box.id, class: "check" }, `${frame}: ${reason}`)))) : null,
      parameters.element,
      said,
    ],
    fields: [
      chosen.size ? { name: "reason", label: "Reason for exclusion", type: "textarea", hint: "What happened when the frame was taken. Recorded with your name.", help: "The new version lists each excluded frame with its reason, and so does every later version that excludes it." } : null,
    ].filter(Boolean),
    submit: "Refit",
    action: async (values) => {
      const kept = keep.filter(({ box }) => box.checked);
      const exclude = [...(await withIds(calibration, kept)), ...[...chosen.keys()].map((frame_id) => ({ frame_id, reason: values.reason }))];
      return (await runJob(`/v1/campaigns/${calibration.campaign_id}/calibrations`, { ...(await parameters.read()), exclude }, said, "Fitting")).calibration_id;
    },
  });
  if (!made) return;
  if (made === calibration.id) toast("This version has the same frames and the same parameters.");
  else await leave(`/calibrations/${made}`);
}

/** Former exclusions name frames as the fit does; the form wants their ids. */
async function withIds(calibration, kept) {
  if (!kept.length) return [];
  const ids = new Map(calibration.points.map((point) => [point.frame, point.frame_id]));
  if (kept.some(({ frame }) => !ids.has(frame))) {
    const hashes = new Map(calibration.inputs.frames.map((each) => [each.sha256, each.frame]));
    for (const each of await all(`/v1/campaigns/${calibration.campaign_id}/frames`)) ids.set(hashes.get(each.sha256), each.id);
  }
  return kept.map(({ frame, reason }) => ({ frame_id: ids.get(frame), reason }));
}
