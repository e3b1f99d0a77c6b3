// The histogram of an area of a map.

import { byId, fill, h } from "../dom.js";
import { select } from "../campaign/forms.js";
import { plot } from "../plots.js";

/** Draw the histogram in the section `histogram-section`. */
export function showHistogram(found, { isLight }) {
  const areas = [["region", "Measured region"], ...(found.grid ? [["grid", "Cells"]] : []), ["frame", "Whole frame"]];
  const area = select(areas, { "aria-label": "Area", title: "Which pixels are counted", onchange: show }, found.grid && found.region_origin !== "request" ? "grid" : "region");
  const axis = select([["logarithmic", "Logarithmic"], ["linear", "Linear"]], { "aria-label": "Axis", title: "Equal ratios or equal differences have equal lengths", onchange: show }, isLight ? "logarithmic" : "linear");
  const csv = h("a", { class: "button", download: "" }, "CSV");
  const place = h("div", { class: "plot", role: "group", "aria-label": "Histogram", tabindex: "0" });
  byId("histogram-section").hidden = false;
  fill(byId("histogram-tools"), area, axis, csv);
  fill(byId("histogram"), place);
  show();

  function show() {
    const query = new URLSearchParams({ area: area.value, axis: axis.value });
    csv.href = `/v1/measurements/${found.id}/histogram.csv?${query}`;
    plot(place, `/plots/measurements/${found.id}/histogram?${query}`);
  }
}
