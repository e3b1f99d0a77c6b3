// Logarithmic or linear colours of one map, or of several on a common scale.

import { h } from "../dom.js";
import { chooseScale } from "./colours.js";

export function scaleTools(views) {
  const { unit } = views[0].map;
  const show = (logarithmic) => {
    const scale = chooseScale(views.map((view) => view.map.squares), { unit, logarithmic });
    for (const view of views) view.show(scale);
  };
  show(unit !== "1");
  if (unit === "1") return null;
  const buttons = [["Logarithmic", true], ["Linear", false]].map(([text, logarithmic]) =>
    h("button", { type: "button", "aria-pressed": String(logarithmic), onclick: (event) => {
      for (const each of buttons) each.setAttribute("aria-pressed", String(each === event.target));
      show(logarithmic);
    } }, text),
  );
  return h("div", { class: "segments", role: "group", "aria-label": "Colours" }, buttons);
}
