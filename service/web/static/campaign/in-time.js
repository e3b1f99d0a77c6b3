// The campaign's frames and readings on the axis of their time, drawn when it is opened.

import { get } from "../api.js";
import { fill, h } from "../dom.js";
import { number, unit } from "../format.js";
import { bracketsOf, timeline } from "../timeline.js";

const ZONED = /(Z|[+-]\d\d:?\d\d)$/;
const OFFSET = /^[+-]\d\d:\d\d$/;

/** The instant of a clock: by its own offset, else by a zone (IANA name or offset), else as UTC. */
export function instantOf(text, zone) {
  if (ZONED.test(text)) return Date.parse(text) || undefined;
  if (OFFSET.test(zone ?? "")) return Date.parse(text + zone) || undefined;
  const shown = Date.parse(`${text}Z`);
  if (!shown || !zone) return shown || undefined;
  const clock = new Intl.DateTimeFormat("sv-SE", { timeZone: zone, dateStyle: "short", timeStyle: "medium" });
  const ahead = (at) => Date.parse(`${clock.format(at).replace(" ", "T")}Z`) - Math.floor(at / 1000) * 1000;
  return shown - ahead(shown - ahead(shown));
}

/** The zone stated for a frame without an offset, as the service applies it: cameras with bands may write UTC, which only their campaign overrules. */
export const zoneOf = (frame, campaign, organisation) => (ZONED.test(frame.taken_at) ? null : campaign.time_zone ?? (frame.band ? null : organisation?.time_zone) ?? null);

/** What was assumed of the clocks of these frames; "" where all state their offset. */
export function assumed(frames, campaign, organisation) {
  const silent = frames.filter((frame) => !ZONED.test(frame.taken_at));
  const zones = [...new Set(silent.map((frame) => zoneOf(frame, campaign, organisation)))];
  return zones.map((zone) => (zone ? `The camera’s clock states no time zone and is read as ${zone}, as the ${campaign.time_zone ? "campaign" : "organisation"} states; drawn in UTC.` : "The camera’s clock states no time zone and is drawn as UTC: frames may lie hours from readings. State the campaign’s time zone with its details.")).join(" ");
}

export function inTimePart(state) {
  const place = h("div");
  const fold = h("details", { class: "fold in-time", ontoggle: () => draw() }, h("summary", {}, "In time ", h("span", { class: "muted" }, "scenes, frames and meter readings")), place);
  let before = "";
  let organisation = null;
  async function draw() {
    const known = state.frames.filter((frame) => frame.taken_at);
    const readings = (state.book?.readings ?? []).filter((each) => !each.withdrawn_at && each.taken_at);
    fold.hidden = !known.length;
    const shown = JSON.stringify([known.map((frame) => [frame.id, frame.scene, frame.role, frame.outcome]), readings.map((each) => each.id), state.campaign.time_zone]);
    if (!fold.open || shown === before) return;
    before = shown;
    organisation ??= await get("/v1/organisation").catch(() => null);
    if (before !== shown) return;
    const frames = known.map((frame) => ({ key: frame.id, role: frame.role, scene: frame.scene, header: { taken: instantOf(frame.taken_at, zoneOf(frame, state.campaign, organisation)), iso: frame.iso } }));
    const marks = readings.map((each) => ({ at: instantOf(each.taken_at), text: `${each.scene}: ${number(each.value, 5)} ${unit(each.unit)}, ${each.taken_at.slice(11, 16)} UTC` }));
    const checked = new Set(known.filter((frame) => ["warn", "fail"].includes(frame.outcome)).map((frame) => frame.id));
    const untimed = state.frames.length - known.length;
    const silent = (state.book?.readings ?? []).filter((each) => !each.withdrawn_at && !each.taken_at).length;
    const notes = [
      assumed(known, state.campaign, organisation),
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
