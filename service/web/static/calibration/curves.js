// The two plots of a calibration that has a curve; a click on a point chooses its frame.

import { byId, may } from "../dom.js";
import { plot } from "../plots.js";

export function drawPlots(calibration, choice) {
  const place = byId("signal-plot");
  const buttons = document.querySelectorAll("[data-axes]");
  const address = `/plots/calibrations/${calibration.id}`;
  const usable = new Set(calibration.points.filter((point) => point.used).map((point) => point.frame_id));
  const show = (within) => {
    for (const point of within.querySelectorAll("[data-frame-id]")) point.classList.toggle("chosen", choice.has(point.dataset.frameId));
  };
  const draw = (element, path) =>
    plot(element, path, (chart) => {
      if (!may("calibrate")) return;
      show(chart);
      chart.addEventListener("click", ({ target: { dataset } }) => {
        if (usable.has(dataset.frameId)) choice.set(dataset.frameId, dataset.frame, !choice.has(dataset.frameId));
      });
    });
  choice.addEventListener("change", () => show(document));
  for (const button of buttons) {
    button.addEventListener("click", () => {
      for (const each of buttons) each.setAttribute("aria-pressed", String(each === button));
      draw(place, `${address}/signal?axes=${button.dataset.axes}`);
    });
  }
  draw(place, `${address}/signal?axes=linear`);
  draw(byId("residuals-plot"), `${address}/residuals`);
}
