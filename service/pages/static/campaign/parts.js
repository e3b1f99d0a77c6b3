// The parts of a campaign's page that come after its frames, each with its place there.

import { get } from "../api.js";
import { fill, h, may } from "../dom.js";
import { counted } from "../format.js";
import { measurementTable } from "../measurement/words.js";
import { empty, load } from "../states.js";
import { calibrateSection } from "./calibrate.js";
import { checklistSection } from "./checklist.js";
import { detailsPart } from "./details.js";
import { inTimePart } from "./in-time.js";
import { regionSection } from "./region.js";
import { targetSection } from "./target.js";

const SHOWN = 100;

function nightSection(state) {
  const results = h("div");
  const head = h("div");
  const show = () => load(results, () => get(`/v1/measurements?campaign_id=${state.id}&limit=${SHOWN}`), ({ items, next }) => (items.length ? [measurementTable(items), next ? h("p", {}, h("a", { href: `/measurements?campaign_id=${state.id}` }, "All measurements of this night")) : null] : empty("No measurements yet", "Frames are measured with the published calibration of their camera.")));
  const draw = () => {
    const file = (name, text) => h("a", { class: "button quiet", href: name, download: "" }, text);
    const of = `${state.path}/measurements`;
    fill(
      head,
      h("p", { class: "muted" }, `${state.campaign.measured} of ${counted(state.frames.length, "frame")} measured.`),
      h(
        "p",
        { class: "actions" },
        may("upload") && state.frames.length ? h("a", { class: "button primary", href: `/measurements/new?campaign=${state.id}&all` }, "Measure all frames") : null,
        may("upload") && state.frames.length ? h("a", { class: "button", href: `/measurements/new?campaign=${state.id}` }, "Measure a frame") : null,
        state.campaign.measured ? [file(`${of}.csv`, "CSV"), file(`${of}.geojson`, "GeoJSON"), file(`/v1/series/measurements?campaign_id=${state.id}&format=json`, "JSON")] : null,
      ),
    );
  };
  state.on("campaign", draw);
  draw();
  show();
  return [head, results];
}

export { uploadSection } from "./upload.js";

export const PARTS = [
  ["details-buttons", detailsPart],
  ["in-time", inTimePart],
  ["target-form", targetSection],
  ["region-tool", regionSection],
  ["checklist-items", checklistSection],
  ["calibrate-tool", calibrateSection],
  ["night-tool", nightSection],
];
