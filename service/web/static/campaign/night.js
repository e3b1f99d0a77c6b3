// A night of measurements: what was measured of its frames, and where to go on.

import { get } from "../api.js";
import { h, may } from "../dom.js";
import { empty, load } from "../states.js";
import { measurementTable } from "../measurement/table.js";

const SHOWN = 100;

export function nightSection(state) {
  const results = h("div");
  const show = () => load(results, () => get(`/v1/measurements?campaign_id=${state.id}&limit=${SHOWN}`), ({ items, next }) => (items.length ? [measurementTable(items), next ? h("p", {}, h("a", { href: `/measurements?campaign_id=${state.id}` }, "All measurements of this night")) : null] : empty("No measurements yet", "Frames are measured with the published calibration of their camera.")));
  show();
  return [may("upload") ? h("p", { class: "actions" }, h("a", { class: "button primary", href: `/measurements/new?campaign=${state.id}` }, "Measure a frame")) : null, results];
}
