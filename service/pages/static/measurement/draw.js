// Regions and grids drawn on a map, and measured there.

import { byId, fill, h } from "../dom.js";
import { methodOf } from "../methods.js";
import { act } from "../states.js";
import { regionPart } from "./region.js";
import { measureOne } from "./start.js";

/** What a measurement of another place of the same frame has in common with this one. */
const SAME = ["reflectance", "incidence_angle_deg", "index", "quantity", "allow"];

/** The tool of one map: the button beside it, and the section `region-section` below it. */
export function regionTool(view, found, frame) {
  const part = regionPart({ place: (canvas) => view.cover(canvas.element), kinds: methodOf(found.method).measurement_options.includes("grid") ? ["drawn", "grid", "lanes"] : ["drawn"] });
  const preview = `/v1/frames/${frame.id}/preview.png`;
  let background = "map";
  const progress = h("span", { class: "muted", role: "status" });
  const button = h("button", { type: "button", "aria-pressed": "false", onclick: () => turn(button.getAttribute("aria-pressed") !== "true") }, "Draw a region");
  const grounds = [["Map", "map"], ["Picture", "picture"]].map(([text, value]) =>
    h("button", { type: "button", "aria-pressed": String(value === background), onclick: (event) => {
      background = value;
      for (const each of grounds) each.setAttribute("aria-pressed", String(each === event.target));
      part.paint(background === "map" ? view.picture : preview);
    } }, text),
  );
  fill(byId("region-tools"), h("div", { class: "segments", role: "group", "aria-label": "Background" }, grounds));
  fill(byId("region"), part.element, h("p", { class: "actions" }, h("button", { type: "button", class: "primary", onclick: (event) => act(event.target, measure) }, "Measure"), progress));
  view.onpaint = () => background === "map" && part.paint(view.picture);
  return button;

  function turn(on) {
    button.setAttribute("aria-pressed", String(on));
    byId("region-section").hidden = !on;
    view.uncover(on);
    if (!on || button.dataset.begun) return;
    button.dataset.begun = "true";
    part.show({ ...frame, roi_id: null }, null, view.picture);
    part.take(found.region, found.grid);
  }

  function measure() {
    const { parameters } = found;
    const kept = Object.fromEntries(SAME.filter((name) => name in parameters).map((name) => [name, parameters[name]]));
    const frames = found.frame_ids ? { frame_ids: found.frame_ids } : { frame_id: found.frame_id };
    return measureOne({ ...frames, ...parameters.conditions, ...kept, ...part.read(), calibration_id: found.calibration.id, products: ["map"] }, progress);
  }
}
