// One frame in a dialog: preview, verdict with reasons, metadata, statistics.

import { get, patch } from "../api.js";
import { h, may, table, toast } from "../dom.js";
import { bytes, exposureTime, fixed, number, percent, tag, time, words } from "../format.js";
import { roleOptions } from "../methods.js";
import { act, load, loading } from "../states.js";
import { decimal, field, select } from "./forms.js";
import { originOf } from "./holding.js";
import { numberOf } from "./numbers.js";
import { isRead } from "./state.js";

export function showFrame(state, id) {
  const body = h("div", { "aria-busy": "true" }, loading(6));
  const dialog = h("dialog", { class: "frame-dialog", "aria-label": state.byId.get(id)?.filename ?? "Frame", onclose: () => dialog.remove() }, body);
  document.body.append(dialog);
  dialog.showModal();
  load(body, () => get(`/v1/frames/${id}`), (frame) => [
    h("div", { class: "section-head" }, h("h2", {}, frame.filename), h("button", { type: "button", class: "quiet", onclick: () => dialog.close() }, "Close")),
    h(
      "div",
      { class: "columns" },
      h("div", {}, picture(frame), h("dl", { class: "facts" }, facts(frame).map(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]))),
      h("div", {}, reasons(frame), may("calibrate") ? change(state, frame, dialog) : null),
    ),
    statistics(state, frame),
    h(
      "p",
      { class: "actions" },
      h("a", { class: "button", href: `/v1/frames/${frame.id}/content` }, "Download the file"),
      may("calibrate") && isRead(frame)
        ? h("button", { type: "button", onclick: () => {
            dialog.close();
            state.dispatchEvent(new CustomEvent("draw-on", { detail: frame.id }));
          } }, frame.roi_origin === "found" ? "Draw another region" : "Draw a region on it")
        : null,
    ),
  ]);
}

const picture = (frame) =>
  isRead(frame) ? h("img", { class: "frame-picture", src: `/v1/frames/${frame.id}/preview.png`, alt: `Preview of ${frame.filename}` }) : null;

function facts(frame) {
  const said = [
    ["Exposure", frame.exposure_time_s && `${exposureTime(frame.exposure_time_s)} · f/${number(frame.f_number, 3)} · ISO ${number(frame.iso, 6)}`],
    ["Camera", frame.camera && [frame.camera.make, frame.camera.model, frame.camera.serial].filter(Boolean).join(" ")],
    ["Size", frame.width_px && `${frame.width_px} × ${frame.height_px} px, ${frame.cfa}, ${bytes(frame.size_bytes)}`],
    ["Black, white", frame.white_level_dn && `${number(frame.black_level_dn, 6)}, ${number(frame.white_level_dn, 6)} DN`],
    ["Taken", frame.taken_at && time(frame.taken_at)],
    ["Received", time(frame.created_at)],
    ["Band", frame.band && words(frame.band)],
    ["Region", originOf(frame)],
    ["Warnings", frame.warnings.length && frame.warnings.map(words).join(", ")],
    ["SHA-256", h("code", { class: "small" }, frame.sha256)],
  ];
  return said.filter(([, value]) => value);
}

function reasons(frame) {
  const { outcome, reasons: why } = frame.verdict;
  return h(
    "div",
    { class: `note ${{ pass: "good", warn: "warn", fail: "bad" }[outcome] ?? ""}` },
    h("p", {}, tag(outcome)),
    why.length ? h("ul", { class: "plain" }, why.map((each) => h("li", {}, each.detail))) : h("p", {}, "No findings."),
  );
}

function statistics(state, frame) {
  const rows = state.statisticsOf(frame);
  if (!rows.length) return null;
  const columns = [
    { head: "Channel", header: true, cell: (row) => row.channel },
    ...[["n", "n", (v) => number(v, 9)], ["Mean", "mean_dn", (v) => fixed(v, 2)], ["Median", "median_dn", (v) => number(v, 6)], ["Std", "std_dn", (v) => fixed(v, 2)], ["Min", "min_dn", (v) => number(v, 6)], ["Max", "max_dn", (v) => number(v, 6)], ["Clipped", "saturated_share", percent], ["At 0", "zero_share", percent]].map(
      ([head, name, show]) => ({ head, class: "number", cell: (row) => show(row[name]) }),
    ),
  ];
  return h("div", { class: "frame-statistics" }, h("h3", {}, "Raw values in the region [DN], black level not subtracted"), table(columns, rows, { caption: "Statistics of the region" }));
}

function change(state, frame, dialog) {
  const role = select(roleOptions(state.method), {}, frame.role);
  const scene = h("input", { value: frame.scene ?? "", list: "detail-scenes", autocomplete: "off" });
  const lacking = frame.exposure_time_s === undefined ? [["exposure_time_s", "Exposure time [s]"], ["f_number", "f-number"], ["iso", "ISO"]].map(([name, label]) => [name, label, decimal({ value: frame.supplied?.[name] ?? "" })]) : [];
  const form = h(
    "form",
    { class: "card", onsubmit: (event) => {
      event.preventDefault();
      act(event.submitter, async () => {
        const said = { role: role.value, ...(scene.value.trim() ? { scene: scene.value.trim() } : {}) };
        for (const [name, , input] of lacking) if (input.value.trim()) said[name] = numberOf(input);
        state.renew(await patch(`/v1/frames/${frame.id}`, said));
        toast(`${frame.filename} was changed and is read again.`);
        dialog.close();
        await state.touch();
      });
    } },
    h("h3", {}, "Role and scene"),
    h("div", { class: "fields" }, field("Role", role), field("Scene", scene), lacking.map(([, label, input]) => field(label, input, "Not in the file."))),
    h("datalist", { id: "detail-scenes" }, state.scenes.map((name) => h("option", { value: name }))),
    h("p", { class: "actions" }, h("button", { type: "submit" }, "Change")),
  );
  return form;
}
