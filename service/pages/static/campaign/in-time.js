// The campaign's frames and readings on the axis of their time, drawn when it is opened.

import { fill, h } from "../dom.js";
import { number, unit } from "../format.js";
import { bracketsOf, timeline } from "../timeline.js";

/** What was assumed of the clocks of these frames; "" where all are known without. */
export function assumed(frames, campaign) {
  const zones = [...new Set(frames.filter((frame) => frame.time_zone || !frame.instant).map((frame) => frame.time_zone))];
  return zones.map((zone) => (zone ? `The camera’s clock states no time zone and is read as ${zone}, as the ${campaign.time_zone ? "campaign" : "organisation"} states; drawn in UTC.` : "The camera’s clock states no time zone and is drawn as UTC: frames may lie hours from readings. State the campaign’s time zone with its details.")).join(" ");
}

export function inTimePart(state) {
  const place = h("div");
  const fold = h("details", { class: "fold in-time", ontoggle: () => draw() }, h("summary", {}, "In time ", h("span", { class: "muted" }, "scenes, frames and meter readings")), place);
  let before = "";
  function draw() {
    const known = state.frames.filter((frame) => frame.taken_at);
    const readings = (state.book?.readings ?? []).filter((each) => !each.withdrawn_at && each.taken_at);
    fold.hidden = !known.length;
    const shown = JSON.stringify([known.map((frame) => [frame.id, frame.scene, frame.role, frame.outcome, frame.instant]), readings.map((each) => each.id)]);
    if (!fold.open || shown === before) return;
    before = shown;
    const frames = known.map((frame) => ({ key: frame.id, role: frame.role, scene: frame.scene, header: { taken: Date.parse(frame.instant ?? `${frame.taken_at}Z`), iso: frame.iso } }));
    const marks = readings.map((each) => ({ at: Date.parse(each.taken_at), text: `${each.scene}: ${number(each.value, 5)} ${unit(each.unit)}, ${each.taken_at.slice(11, 16)} UTC` }));
    const checked = new Set(known.filter((frame) => ["warn", "fail"].includes(frame.outcome)).map((frame) => frame.id));
    const untimed = state.frames.length - known.length;
    const silent = (state.book?.readings ?? []).filter((each) => !each.withdrawn_at && !each.taken_at).length;
    const notes = [
      assumed(known, state.campaign),
      untimed ? `Frames without a time: ${untimed}.` : "",
      silent ? `Readings without a time: ${silent}.` : "",
    ].filter(Boolean);
    fill(place, timeline({ scenes: bracketsOf(frames), frames }, { checked, readings: marks }) ?? h("p", { class: "muted" }, "All frames have one time."), notes.length ? h("p", { class: "small muted" }, notes.join(" ")) : null);
  }
  for (const name of ["frames", "campaign"]) state.on(name, draw);
  state.book?.addEventListener("change", draw);
  draw();
  return fold;
}
