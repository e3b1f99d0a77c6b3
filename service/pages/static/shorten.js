// A long list starts short, with a button for the rest.

import { h } from "./dom.js";

const AT_FIRST = 14;

/** `draw` makes what shows some of the rows. */
export function shorten(rows, draw, count = AT_FIRST) {
  if (rows.length <= count + 4) return draw(rows);
  const place = h("div", {}, draw(rows.slice(0, count)));
  const more = h("button", { type: "button", class: "quiet" }, `Show all ${rows.length}`);
  more.addEventListener("click", () => (place.replaceChildren(draw(rows)), more.remove()));
  return [place, h("p", { class: "more" }, more)];
}
