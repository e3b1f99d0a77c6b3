// How far a campaign is: what has come, what it still lacks, what would make it good.

import { figure, fill, h } from "../dom.js";
import { counted, number } from "../format.js";
import { countOwn } from "./holding.js";

export function overview(state) {
  const element = h("div", { class: "overview" });
  const draw = () => fill(element, figures(state), advice(state.campaign));
  state.on("campaign", draw);
  state.on("frames", draw);
  draw();
  return element;
}

export function countOutcomes(state) {
  const counts = { pass: 0, warn: 0, fail: 0, pending: 0 };
  for (const verdict of state.verdicts.values()) counts[verdict.outcome] += 1;
  return counts;
}

function figures(state) {
  const { frames, readings } = state.campaign;
  const counts = countOutcomes(state);
  const received = Math.max(frames.received, state.frames.length);
  const told = state.verdicts.size
    ? [`${counts.pass} pass`, counts.warn && `${counts.warn} warn`, counts.fail && `${counts.fail} fail`, counts.pending && `${counts.pending} waiting`].filter(Boolean).join(" · ")
    : "";
  return h(
    "dl",
    { class: "figures" },
    figure("Frames", number(received), told),
    region(state),
    state.method.reference === "meter" ? figure("Readings", number(readings), state.scenes.length ? counted(state.scenes.length, "scene") : "") : null,
    figure("Fit", state.campaign.missing.length ? "Not yet" : "Ready", state.campaign.missing.length ? `${state.campaign.missing.length} missing` : "nothing is missing", marked(state.campaign.missing.length > 0)),
  );
}

const marked = (lacking) => ({ class: lacking ? "lacking" : null });

function region({ roi, method, frames }) {
  const { own, found, said } = countOwn(frames);
  if (roi) return figure("Region", roi.regions ? counted(roi.regions.length, "part") : counted(roi.polygon.length, "corner"), said);
  if (method.whole_frame) return figure("Region", "Whole frame", said);
  return figure("Region", own ? (found === own ? "Found" : "Per frame") : "None yet", said, marked(!own));
}

function advice({ missing, advice: better }) {
  if (!missing.length && !better.length) return null;
  return h(
    "div",
    { class: "columns advice" },
    missing.length ? h("div", { class: "note warn" }, h("h2", {}, "Missing"), listOf(missing)) : null,
    better.length ? h("div", { class: "note" }, h("h2", {}, "Suggestions"), listOf(better)) : null,
  );
}

function listOf(sentences) {
  const [shown, more] = [sentences.slice(0, 5), sentences.slice(5)];
  const items = (some) => h("ul", { class: "plain" }, some.map((each) => h("li", {}, sentence(each))));
  return [items(shown), more.length ? h("details", {}, h("summary", {}, `${more.length} more`), items(more)) : null];
}

export const sentence = (text) => text.charAt(0).toUpperCase() + text.slice(1);
