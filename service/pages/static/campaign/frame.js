// One frame over the grid: large picture with its region, verdict with its repair, histogram, exposure, and what can be changed.

import { get } from "../api.js";
import { act, fill, h, isPressed, lettersOn, load, mark, may, openDialog } from "../dom.js";
import { bytes, exposureTime, fixed, number, percent, stateWords, time, typeset, words } from "../format.js";
import { frameCell, kindOf, sayState } from "./rows.js";
import { lookPart } from "./look.js";
import { askExposure, askWhere, leaveOut, withdraw } from "./moves.js";
import { holdingFor, isRead, originOf } from "./state.js";
import { viewerPart } from "./viewer.js";

const MOST_BESIDE = 24;

/** Open a frame; `order` is that of the grid, `walked` hears of each other one, `back` of the one that was seen last. Answers {show, close}. */
export function openFrame(state, first, { order, walked: goes, back }) {
  let id;
  const [title, count, look, tell] = [h("h2", { id: "frame-name" }), h("span", { class: "muted small" }), h("div", { class: "look-at" }), h("div", { class: "tell" })];
  const others = h("div");
  const at = () => order.findIndex((frame) => frame.id === id);
  const go = (by) => {
    const next = order[at() + by];
    if (next) show(next.id);
  };
  const toCheck = () => {
    const rest = [...order.slice(at() + 1), ...order.slice(0, at())];
    const next = rest.find((frame) => ["warn", "bad"].includes(kindOf(state.byId.get(frame.id) ?? frame)));
    if (next) show(next.id);
  };
  const viewer = viewerPart(state);
  const histogram = lookPart((clipping) => viewer.picture.showClipping(clipping));
  const drawLook = (frame, roi) => {
    const seen = isRead(frame);
    if (seen) viewer.show(frame, roi);
    // the viewer stays where it is: its buttons keep their focus
    if (!seen || !look.contains(viewer.element)) fill(look, seen ? viewer.element : h("p", { class: "empty" }, "No preview: the frame has not been read, or it was refused."), others);
    if (!isPressed(others)) fill(others, beside(state, state.byId.get(id), show));
    state.pictures.show();
  };
  const button = (text, onclick, attributes = {}) => h("button", { type: "button", class: "small-button", onclick, ...attributes }, text);
  const [before, after, check] = [button("← Previous", () => go(-1)), button("Next →", () => go(1)), button("Next to check →", toCheck)];
  // the same elements for every frame: a press is never lost to a redraw, and acts on the frame that is named
  const press = (work) => (event) => act(event.target, () => work(state, [id]));
  const [move, enter] = [button("Move…", press(askWhere)), button("Enter exposure…", press(askExposure))];
  const out = button("", press(leaveOut), { title: "What is left out is kept, and not fitted or measured with the others" });
  const gone = button("", press(withdraw), { class: "small-button danger", title: "What is withdrawn is hidden from the campaign, and can be restored" });
  const region = button("", () => {
    goes("");
    dialog.close();
    state.dispatchEvent(new CustomEvent("draw-on", { detail: id }));
  });
  const download = h("a", { class: "button quiet small-button" }, "Download");
  const dialog = h("dialog", { class: "frame-sheet", tabindex: "-1", "aria-labelledby": "frame-name", onclose: () => (state.removeEventListener("frames", renew), back(id)) },
    h("div", { class: "sheet-head" }, h("div", { class: "title-line" }, title, count), h("p", { class: "actions" }, before, after, button(["Close ", h("kbd", {}, "Esc")], () => dialog.close(), { class: "quiet small-button" }))),
    h("div", { class: "sheet-body" }, look, tell),
    h("div", { class: "sheet-foot" }, h("p", { class: "actions" }, may("calibrate") ? [move, enter, out, gone, region] : null, download), h("span", { class: "small muted" }, h("kbd", {}, "←"), " ", h("kbd", {}, "→"), " walk  ", h("kbd", {}, "M"), " move  ", h("kbd", {}, "X"), " leave out  ", h("kbd", {}, "Z"), " undo"), check),
  );
  const renew = () => show(id);
  state.on("frames", renew);
  dialog.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.target.closest("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey || event.target.closest("dialog") !== dialog) return;
    const letter = lettersOn() ? event.key.toLowerCase() : "";
    if (event.key === "ArrowLeft") go(-1);
    else if (event.key === "ArrowRight") go(1);
    else if (letter === "n") toCheck();
    else if (letter === "m" && may("calibrate")) askWhere(state, [id]);
    else if (letter === "x" && may("calibrate")) act(out, () => leaveOut(state, [id]));
    else return;
    event.preventDefault();
  });
  // a button that has just been disabled or replaced keeps no focus
  const keepFocus = () => dialog.open && (document.activeElement === document.body || document.activeElement.disabled) && dialog.focus();

  function show(wanted) {
    const walked = wanted !== id;
    id = wanted;
    const known = state.byId.get(id);
    title.textContent = known.filename;
    count.textContent = [known.scene, `${at() + 1} of ${order.length}`].filter(Boolean).join(" · ");
    before.disabled = at() <= 0;
    after.disabled = at() >= order.length - 1;
    check.disabled = !order.some((frame) => frame.id !== id && ["warn", "bad"].includes(kindOf(state.byId.get(frame.id) ?? frame)));
    out.textContent = known.left_out === null ? "Leave out" : "Use again";
    gone.textContent = known.withdrawn ? "Restore" : "Withdraw";
    region.textContent = known.roi_origin === "found" ? "Draw another region" : "Draw a region on it";
    region.hidden = !known.thumbnail;
    enter.hidden = known.exposure_time_s !== null || known.state === "received";
    download.href = `/v1/frames/${id}/content`;
    if (walked) {
      goes(id);
      // nothing of the frame before is left beside the name of this one
      dialog.querySelectorAll(".act-failed").forEach((old) => old.remove());
      drawLook(known, null);
      fill(tell, verdict(known), exposure(known));
    }
    keepFocus();
    load(tell, () => Promise.all([get(`/v1/frames/${id}`), holdingFor(state, known)]), ([frame, roi]) => {
      const unfolded = tell.querySelector("details")?.open;
      drawLook(frame, roi);
      if (isRead(frame)) histogram.look(frame, { points: roi?.polygon ?? [[0, 0], [frame.width_px, 0], [frame.width_px, frame.height_px], [0, frame.height_px]], closed: true });
      return [verdict(known, frame), exposure(frame), h("div", {}, h("h3", { class: "panel-title" }, "Raw values in the region [DN]"), histogram.element), file(frame, unfolded)];
    }).then(keepFocus);
  }

  show(first);
  openDialog(dialog);
  return { show, close: () => dialog.close() };
}

function beside(state, known, show) {
  const same = state.frames.filter((frame) => frame.role === known.role && frame.scene === known.scene);
  const from = Math.max(0, Math.min(same.indexOf(known) - MOST_BESIDE / 2, same.length - MOST_BESIDE));
  const strip = same.slice(from, from + MOST_BESIDE).map((frame) => {
    const cell = frameCell(frame, { place: "", compact: false });
    cell.tabIndex = 0;
    cell.draggable = false;
    cell.addEventListener("click", () => show(frame.id));
    if (frame.id === known.id) cell.setAttribute("aria-current", "true");
    return cell;
  });
  return same.length > 1 ? [h("h3", { class: "panel-title" }, known.scene ? "Same scene" : "Same role"), h("div", { class: "strip", tabindex: "-1" }, strip)] : null;
}

/** `frame` once it has been read: until then the gravest reason alone is known. */
function verdict(known, frame) {
  const kind = kindOf(known);
  const reasons = frame ? (frame.verdict?.reasons ?? []) : known.code ? [known] : [];
  const said = frame?.left_out ? [`Left out by ${frame.left_out.by}: ${frame.left_out.reason}`] : [];
  return h("div", { class: `verdict-words ${kind}` }, mark(kind), h("h3", {}, sayState(known)), [...said, ...reasons.map((each) => typeset(each.detail))].map((text) => h("p", {}, text)), !frame || said.length + reasons.length ? null : h("p", {}, "No problems found."));
}

function exposure(frame) {
  const facts = [["Exposure", exposureTime(frame.exposure_time_s)], ["Aperture", frame.f_number ? `f/${number(frame.f_number, 3)}` : "–"], ["Sensitivity", frame.iso ? `ISO ${frame.iso}` : "–"]];
  return h("dl", { class: "shots" }, facts.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))));
}

function file(frame, open = false) {
  const facts = [
    ["Camera", frame.camera && [frame.camera.make, frame.camera.model, frame.camera.serial].filter(Boolean).join(" ")],
    ["Size", frame.width_px && `${frame.width_px} × ${frame.height_px} px, ${frame.cfa}`],
    ["Black, white", frame.white_level_dn && `${number(frame.black_level_dn, 6)}, ${number(frame.white_level_dn, 6)} DN`],
    ["Region", originOf(frame)],
    ["Band", frame.band && words(frame.band)],
    ["Clipped, zeros", frame.statistics.length && `${percent(Math.max(...frame.statistics.map((row) => row.saturated_share)))}, ${percent(Math.max(...frame.statistics.map((row) => row.zero_share)))}`],
    ["Pixel scatter", frame.statistics.length && `${fixed(Math.max(...frame.statistics.map((row) => row.std_dn)), 1)} DN`],
    ["Warnings", frame.warnings.length && frame.warnings.map(stateWords).join(", ")],
    ["Received", time(frame.created_at)],
    ["SHA-256", h("code", { class: "small" }, frame.sha256)],
  ].filter(([, value]) => value);
  return h("details", { class: "fold", open }, h("summary", {}, "File ", h("span", { class: "muted" }, [frame.taken_at?.replace("T", " ").slice(0, 19), frame.size_bytes && bytes(frame.size_bytes)].filter(Boolean).join(" · "))), h("dl", { class: "facts" }, facts.map(([name, value]) => [h("dt", {}, name), h("dd", {}, value)])));
}
