// What is seen of one frame: all of it or its pixels, alone or beside another frame at the same place.

import { h } from "../dom.js";
import { exposureTime } from "../format.js";
import { select } from "./forms.js";
import { holdingFor } from "./holding.js";
import { LargePicture } from "./pixels.js";
import { isRead } from "./state.js";

const BLINK_MS = 700;
const MOST_LISTED = 200;
/** Exposures that differ by less than camera and file state. */
const SAME_EXPOSURE = 0.01;

/** {element, picture, show(frame, roi)}; the place stays from frame to frame. */
export function viewerPart(state) {
  let frame = null;
  let points = null;
  let blinking = false;
  let timer;
  const same = (view) => {
    if (view.size.join() === other.size.join() && view.box.join() !== other.box.join()) other.look(view.box);
  };
  const back = (view) => {
    if (comparing() && view.size.join() === picture.size.join() && view.box.join() !== picture.box.join()) picture.look(view.box);
  };
  const other = new LargePicture({ label: `Frame to compare with. ${KEYS}`, tell: (view) => back(view), rangeOf: async (shown) => (isAlike(shown, frame) ? picture.range : null) });
  const picture = new LargePicture({ label: `Frame. ${KEYS}`, tell: (view) => (told(), comparing() && same(view)) });

  const press = (text, onclick) => h("button", { type: "button", "aria-pressed": "false", onclick }, text);
  const whole = press("Fit", () => picture.fit());
  const pixels = press("100 %", () => picture.showPixels(points));
  const beside = press("Compare", () => compare(comparing() ? null : candidates()[0]));
  const chosen = select([], { "aria-label": "Frame to compare with", title: "Shown at the same place and zoom", onchange: () => compare(state.byId.get(chosen.value)) });
  const blink = press("Blink", () => setBlinking(!blinking));
  const swap = h("button", { type: "button", class: "small-button", onclick: () => turn() }, "Swap");
  const named = [h("figcaption", { class: "small" }), h("figcaption", { class: "small" })];
  const figures = [h("figure", {}, picture.element, named[0], picture.caption), h("figure", {}, other.element, named[1], other.caption)];
  const pair = h("div", { class: "pair" }, figures);
  const way = h("span", { class: "actions" }, chosen, h("span", { class: "segments" }, blink), swap);
  const element = h("div", {}, pair, h("div", { class: "under-picture" }, h("div", { class: "segments", role: "group", "aria-label": "View" }, whole, pixels, beside), way));

  const comparing = () => !figures[1].hidden;
  const candidates = () => state.frames.filter((each) => each.id !== frame?.id && isRead(each) && each.width_px === frame?.width_px && each.height_px === frame?.height_px).sort((a, b) => (b.scene === frame.scene) - (a.scene === frame.scene)).slice(0, MOST_LISTED);

  function told() {
    whole.setAttribute("aria-pressed", String(picture.isWhole));
    pixels.setAttribute("aria-pressed", String(!picture.isWhole && Math.abs(picture.scale - 1) < 0.02));
  }

  function turn() {
    pair.classList.toggle("second");
  }

  /** One in the place of the other, by turns until it is pressed again; by hand alone for who wants no motion. */
  function setBlinking(on) {
    blinking = on;
    clearInterval(timer);
    if (on && !matchMedia("(prefers-reduced-motion: reduce)").matches) timer = setInterval(() => (element.isConnected ? turn() : clearInterval(timer)), BLINK_MS);
    blink.setAttribute("aria-pressed", String(on));
    pair.classList.toggle("stacked", on);
    swap.hidden = !on;
    if (!on) pair.classList.remove("second");
  }

  async function compare(against) {
    figures[1].hidden = way.hidden = !against;
    beside.setAttribute("aria-pressed", String(Boolean(against)));
    named[0].textContent = against ? describe(frame) : "";
    if (!against) return setBlinking(false);
    pair.classList.remove("second");
    const listed = candidates();
    chosen.replaceChildren(...listed.map((each) => h("option", { value: each.id, selected: each.id === against.id }, [each.filename, each.scene].filter(Boolean).join(" · "))));
    named[1].textContent = describe(against);
    other.show(against, outlinesOf(await holdingFor(state, against)));
    other.look(picture.box);
  }

  compare(null);
  return {
    element,
    picture,
    show(next, roi) {
      const walked = next.id !== frame?.id;
      frame = next;
      const outlines = outlinesOf(roi);
      points = outlines.flat();
      picture.show(frame, outlines);
      beside.disabled = candidates().length === 0;
      const against = comparing() ? (chosen.value === frame.id ? candidates()[0] : state.byId.get(chosen.value)) : null;
      if (walked && comparing()) compare(candidates().includes(against) ? against : candidates()[0]);
    },
  };
}

const KEYS = "Arrows move the picture, plus and minus zoom, 0 shows all.";
const outlinesOf = (roi) => (roi ? (roi.regions?.map((each) => each.polygon) ?? [roi.polygon]) : []);
const exposureOf = ({ exposure_time_s: t, iso, f_number: f }) => (t * iso) / f ** 2;
const isAlike = (a, b) => Math.abs(exposureOf(a) / exposureOf(b) - 1) < SAME_EXPOSURE;
const describe = ({ filename, scene, exposure_time_s: t, f_number: f, iso }) => [filename, scene, t && exposureTime(t), f && `f/${f}`, iso && `ISO ${iso}`].filter(Boolean).join(" · ");
