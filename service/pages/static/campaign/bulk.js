// What is done to all selected frames at once.

import { h } from "../dom.js";
import { roleOptions } from "../methods.js";
import { act } from "../states.js";
import { select } from "./forms.js";
import { askExposure, changeFrames, leaveOut, withdraw } from "./moves.js";

/** `chosen` are the ids; `after` is called when something was done. */
export function bulkForm(state, chosen, after) {
  const role = select([["", "keep"], ...roleOptions(state.method)], { "aria-label": "Role of the selected frames", title: "What the frames show" });
  const scene = h("input", { "aria-label": "Scene of the selected frames", title: "The light level or view that the frames show", placeholder: "keep", list: "scenes" });
  const change = async () => {
    const said = { ...(role.value ? { role: role.value } : {}), ...(scene.value.trim() ? { scene: scene.value.trim() } : {}) };
    if (!Object.keys(said).length) return;
    await changeFrames(state, [...chosen], said, (named) => `${named} changed.`);
    after();
  };
  const button = (text, work, attributes = {}) => h("button", { type: "button", ...attributes, onclick: (event) => act(event.target, async () => (await work(state, [...chosen]), after())) }, text);
  return [
    h("strong", { class: "bulk-count" }),
    h("label", {}, "Role ", role),
    h("label", {}, "Scene ", scene),
    h("datalist", { id: "scenes" }, state.scenes.map((name) => h("option", { value: name }))),
    h("span", { class: "actions" }, h("button", { type: "button", class: "primary", onclick: (event) => act(event.target, change) }, "Change"), button("Exposure…", askExposure), button("Leave out", leaveOut), button("Withdraw", withdraw, { class: "danger" }), h("button", { type: "button", class: "quiet", onclick: after }, "Clear selection")),
  ];
}
