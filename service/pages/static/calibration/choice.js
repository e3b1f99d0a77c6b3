// Points selected in a plot or in the table, to be excluded from a new fit.

import { byId, fill, h, may } from "../dom.js";
import { counted } from "../format.js";
import { fitAnew } from "./refit.js";

export class Choice extends EventTarget {
  frames = new Map();
  calibration = null;

  /** From now on there is something to refit. */
  offer(calibration) {
    this.calibration = calibration;
    this.draw();
  }

  has(frameId) {
    return this.frames.has(frameId);
  }

  set(frameId, name, chosen) {
    if (chosen === this.has(frameId)) return;
    if (chosen) this.frames.set(frameId, name);
    else this.frames.delete(frameId);
    this.changed();
  }

  clear() {
    this.frames.clear();
    this.changed();
  }

  changed() {
    this.draw();
    this.dispatchEvent(new Event("change"));
  }

  draw() {
    const bar = byId("chosen");
    const count = this.frames.size;
    bar.hidden = !count || !may("calibrate");
    if (bar.hidden) return;
    const names = [...this.frames.values()];
    fill(
      bar,
      h("p", {}, h("strong", {}, `${counted(count, "frame")} selected`), h("span", { class: "muted names" }, ` ${names.slice(0, 3).join(", ")}${count > 3 ? "…" : ""}`)),
      h(
        "span",
        { class: "actions" },
        h("button", { type: "button", class: "quiet", onclick: () => this.clear() }, "Clear"),
        h("button", { type: "button", class: "primary", onclick: () => fitAnew(this.calibration, this.frames) }, "Exclude and refit…"),
      ),
    );
  }
}
