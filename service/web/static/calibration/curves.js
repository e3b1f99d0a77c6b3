// The two plots of a calibration that has a curve; a click on a point chooses its frame.

import { byId, may } from "../dom.js";
import { plot } from "../plots.js";

export function drawPlots(calibration, choice) {
  const place = byId("signal-plot");
  const buttons = document.querySelectorAll("[data-axes]");
  const address = `/plots/calibrations/${calibration.id}`;
  const usable = new Set(calibration.points.filter((point) => point.used).map((point) => point.frame_id));
  const draw = async (element, path) => link(await plot(element, path), choice, usable);
  for (const button of buttons) {
    button.addEventListener("click", () => {
      for (const each of buttons) each.setAttribute("aria-pressed", String(each === button));
      draw(place, `${address}/signal?axes=${button.dataset.axes}`);
    });
  }
  draw(place, `${address}/signal?axes=linear`);
  draw(byId("residuals-plot"), `${address}/residuals`);
}

/** Selected points are chosen frames, in both directions. */
function link(views, choice, usable) {
  if (!views || !may("calibrate")) return;
  const sources = [...views].flatMap((view) => view.model.renderers ?? []).filter((each) => each.name === "points").map((each) => each.data_source);
  let heard = true;
  const show = () => {
    heard = false;
    for (const source of sources) source.selected.indices = source.data.frame_id.flatMap((id, index) => (choice.has(id) ? [index] : []));
    heard = true;
  };
  for (const source of sources) {
    source.selected.properties.indices.change.connect(() => {
      if (!heard) return;
      const { frame_id: ids, frame: names } = source.data;
      const selected = new Set(source.selected.indices);
      for (const [index, id] of ids.entries()) if (usable.has(id)) choice.set(id, names[index], selected.has(index));
      show();
    });
  }
  choice.addEventListener("change", show);
  show();
}
