// The plots that the method declares; a click on a point chooses its frame, and pointing at it lights it in all plots.

import { may } from "../dom.js";
import { plot } from "../plots.js";

export function drawPlots(calibration, choice) {
  const places = [...document.querySelectorAll("[data-plot]")];
  const usable = new Set(calibration.points.filter((point) => point.used).map((point) => point.frame_id));
  const mark = (name, holds) => {
    for (const point of document.querySelectorAll(".point[data-frame-id]")) point.classList.toggle(name, holds(point.dataset.frameId));
  };
  const show = () => mark("chosen", (id) => choice.has(id));
  for (const place of places) {
    plot(place, `/plots/calibrations/${calibration.id}/${place.dataset.plot}`, show);
    place.addEventListener("pointerover", ({ target: { dataset } }) => mark("lit", (id) => id === dataset.frameId));
    if (!may("calibrate")) continue;
    place.addEventListener("click", ({ target: { dataset } }) => {
      if (usable.has(dataset.frameId)) choice.set(dataset.frameId, dataset.frame, !choice.has(dataset.frameId));
    });
  }
  choice.addEventListener("change", show);
}
