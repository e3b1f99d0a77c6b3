// How far a campaign is: what has come, what it still lacks, what would make it good.

import { patch } from "../api.js";
import { figure, fill, h, isPressed, may } from "../dom.js";
import { counted, number } from "../format.js";
import { act } from "../states.js";
import { countOwn } from "./holding.js";
import { beforeTheFit, missingCauses } from "./missing.js";

export function overview(state) {
  const element = h("div", { class: "overview" });
  const draw = () => {
    if (isPressed(element)) return void requestAnimationFrame(draw);
    const open = element.querySelector("details")?.open ?? false;
    fill(element, figures(state), offer(state), beforeTheFit(state.campaign, state.method.measures ? "Before measuring" : "Before the fit"));
    element.querySelector("details")?.toggleAttribute("open", open);
  };
  state.on("campaign", draw);
  state.on("frames", draw);
  draw();
  return element;
}

function countOutcomes(state) {
  const counts = { pass: 0, warn: 0, fail: 0, pending: 0 };
  for (const frame of state.frames) counts[frame.outcome] += 1;
  return counts;
}

function figures(state) {
  const { frames, readings } = state.campaign;
  const counts = countOutcomes(state);
  const received = Math.max(frames.received, state.frames.length);
  const told = state.frames.length
    ? [`${counts.pass} pass`, counts.warn && `${counts.warn} warn`, counts.fail && `${counts.fail} fail`, counts.pending && `${counts.pending} waiting`].filter(Boolean).join(" · ")
    : "";
  return h(
    "dl",
    { class: "figures" },
    figure("Frames", number(received), told),
    region(state),
    state.method.reference === "meter" ? figure("Readings", number(readings), state.scenes.length ? counted(state.scenes.length, "scene") : "") : null,
    state.method.measures ? figure("Measured", number(state.campaign.measured), "field frames; never used to calibrate") : figure("Fit", state.campaign.missing.length ? "Not yet" : "Ready", state.campaign.missing.length ? `${missingCauses(state.campaign.missing).length} missing` : "nothing is missing", marked(state.campaign.missing.length > 0)),
  );
}

const marked = (lacking) => ({ class: lacking ? "lacking" : null });

function region({ roi, method, frames }) {
  const { own, found, said } = countOwn(frames);
  if (roi) return figure("Region", roi.regions ? counted(roi.regions.length, "part") : counted(roi.polygon.length, "corner"), said);
  if (method.measures) return figure("Region", own ? "Per frame" : "None yet", said || "or with the measurement");
  if (method.whole_frame) return figure("Region", "Whole frame", said);
  return figure("Region", own ? (found === own ? "Found" : "Per frame") : "None yet", said, marked(!own));
}

/** Another panel than the campaign's: one click names it, and registers it as its files state it. */
function offer(state) {
  const panel = state.campaign.panel_offered;
  if (!panel) return null;
  const stated = panel.bands.map((band) => `${band.band} ${number(band.reflectance)}`).join(", ");
  const known = panel.registered ? "It is registered." : stated ? `Its files state ${stated}.` : "Its files do not state what it reflects: register it.";
  const button = h("button", { type: "button" }, `Use panel ${panel.serial}`);
  const take = async () => {
    await patch(state.path, { panel_serial: panel.serial });
    await state.touch();
  };
  button.addEventListener("click", () => act(button, take));
  return h("div", { class: "note warn" }, h("h2", {}, `The frames show panel ${panel.serial}`), h("p", {}, `It is not the campaign’s panel. ${known}`), may("calibrate") && (panel.registered || stated) ? h("p", { class: "actions" }, button) : null);
}
