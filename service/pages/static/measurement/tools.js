// Colours of one map, or of several on a common scale: logarithmic or linear, or those of the uncertainty.

import { get } from "../api.js";
import { byId, fill, h } from "../dom.js";
import { chooseScale } from "./colours.js";

const LABEL = "% expanded uncertainty of the value, k = 2";

export function scaleTools(views) {
  const { unit } = views[0].map;
  const show = (logarithmic) => {
    const scale = chooseScale(views.map((view) => view.map.squares), { unit, logarithmic });
    for (const view of views) view.show(scale);
    const notes = byId("layer-notes");
    if (notes) fill(notes);
  };
  show(unit !== "1");
  const kinds = unit === "1" ? [["Values", () => show(false)]] : [["Logarithmic", () => show(true)], ["Linear", () => show(false)]];
  if (views.length === 1 && views[0].map.uncertainty) kinds.push(["Uncertainty", () => showUncertainty(views[0])]);
  if (kinds.length === 1) return null;
  const buttons = kinds.map(([text, draw], at) =>
    h("button", { type: "button", "aria-pressed": String(!at), onclick: (event) => {
      for (const each of buttons) each.setAttribute("aria-pressed", String(each === event.target));
      draw();
    } }, text),
  );
  return h("div", { class: "segments", role: "group", "aria-label": "Colours" }, buttons);
}

/** The relative expanded uncertainty of each square, where there is light. */
async function showUncertainty(view) {
  const { map } = view;
  map.layer ??= get(`/v1/measurements/${map.id}/map.json?step=${map.step}&layer=expanded_uncertainty_rel`);
  const { values, notes } = await map.layer;
  const shares = values.map((line) => line.map((value) => (value === null ? null : 100 * value)));
  view.show(chooseScale([shares], { unit: "%", logarithmic: true }), shares, LABEL);
  const of = map.step > 1 ? `Of the mean over squares of ${map.step} px; a single pixel has more.` : "Of single pixels.";
  fill(byId("layer-notes"), [of, ...notes].map((note) => h("li", {}, note)));
}
