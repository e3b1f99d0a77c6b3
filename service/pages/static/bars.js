// Shares as bars.

import { h } from "./dom.js";

/** Bars with their names and figures: {name, share 0..1, said, more?}. */
export function bars(rows) {
  return h(
    "dl",
    { class: "bars" },
    rows.map(({ name, share, said, more }) => {
      const bar = h("span", { class: "bar", "aria-hidden": "true" });
      bar.style.width = `${Math.max(0.5, 100 * share)}%`;
      return h("div", { title: more }, h("dt", {}, name), h("dd", {}, h("span", { class: "track" }, bar), h("span", { class: "said" }, said)));
    }),
  );
}
