// One cell of the grid: a frame with its verdict, or a gap with what to photograph.

import { h } from "../dom.js";
import { exposureTime, number, stateWords, typeset } from "../format.js";
import { OUTCOMES, mark } from "../marks.js";
import { imageOf } from "./pictures.js";

/** The mark of a frame: that of its verdict, unless it was left out. */
export const kindOf = (frame) => (frame.withdrawn || frame.left_out !== null ? "out" : OUTCOMES[frame.outcome][0]);

/** Its state in a word. */
export function sayState(frame) {
  if (frame.withdrawn) return "Withdrawn";
  if (frame.left_out !== null) return "Left out";
  return OUTCOMES[frame.outcome][1];
}

const sayExposure = (frame) => (frame.exposure_time_s ? `${exposureTime(frame.exposure_time_s)}, f/${number(frame.f_number, 3)}, ISO ${frame.iso}` : "no exposure");

const thumbnail = (frame) =>
  frame.thumbnail
    ? h("img", { class: "picture", ...imageOf(frame), alt: "", decoding: "async", width: 76, height: 57, draggable: "false" })
    : h("span", { class: "picture" }, mark(frame.state === "refused" ? "bad" : "wait"));

/** What changes the look of a frame's cell. */
export const lookOf = (frame) => [frame.id, frame.state, frame.outcome, frame.code, frame.left_out, frame.withdrawn, frame.signal_dn, frame.exposure_time_s, frame.scene, frame.thumbnail];

export function frameCell(frame, { place, chosen, compact }) {
  const kind = kindOf(frame);
  const why = ["warn", "bad"].includes(kind) && frame.code ? stateWords(frame.code) : kind === "out" ? sayState(frame).toLowerCase() : frame.state === "received" ? "received" : "";
  return h(
    "button",
    { type: "button", class: `cell ${kind}${chosen ? " chosen" : ""}`, tabindex: "-1", draggable: "true", "data-id": frame.id, "aria-label": `${frame.filename}: ${[place, sayExposure(frame), sayState(frame).toLowerCase(), why].filter(Boolean).join(", ")}${chosen ? ", selected" : ""}`, title: frame.detail ?? frame.filename },
    thumbnail(frame),
    h("span", { class: "pv" }, mark(kind)),
    compact ? null : h("span", { class: "says" }, h("b", {}, frame.exposure_time_s ? exposureTime(frame.exposure_time_s) : frame.filename), frame.signal_dn === null ? null : `${number(frame.signal_dn, 4)} DN`, why ? h("em", {}, why) : null),
  );
}

/** A suggested time, as cameras mark theirs. */
const suggest = (seconds) => (seconds < 0.3 ? `1/${Number((1 / seconds).toPrecision(2))} s` : `${Number(seconds.toPrecision(2))} s`);

export function gapCell(gap, { place, compact }) {
  const how = typeset([gap.exposure_time_s && suggest(gap.exposure_time_s), gap.text].filter(Boolean).join(": "));
  return h(
    "button",
    { type: "button", class: "cell-gap", tabindex: "-1", title: how, "aria-label": `${["To photograph", place, how].filter(Boolean).join(", ")}` },
    compact ? h("b", {}, "+") : [h("b", {}, "To photograph"), h("span", {}, how)],
  );
}

/** The repeats of a cell that are not shown each, with their count; and the way back. */
export function pileCell({ key, more, toCheck }, { place }) {
  const said = more ? `${number(more, 6)} more` : "Show fewer";
  const check = toCheck ? `${number(toCheck, 6)} to check` : "";
  return h(
    "button",
    { type: "button", class: "cell-pile", tabindex: "-1", "data-pile": key, "aria-expanded": String(!more), "aria-label": [said, place, check].filter(Boolean).join(", ") },
    h("b", {}, said),
    check ? h("span", {}, mark("warn"), " ", check) : null,
  );
}
