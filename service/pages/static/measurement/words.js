// Names of measured quantities.

import { filename, h, table } from "../dom.js";
import { number, quantity, stateWords, tag, time, words } from "../format.js";
import { methodOf } from "../methods.js";

export function measurementTable(rows, first) {
  const columns = [
    ...(first ? [first] : []),
    { head: h("span", { class: "hidden" }, "Image"), class: "thumb wide-only", cell: (row) => h("img", { src: `/v1/frames/${row.frame_id}/thumbnail.png`, alt: "", loading: "lazy", width: 72, height: 48 }) },
    { head: "Frame", header: true, class: "frame-name", cell: (row) => [h("a", { href: `/measurements/${row.id}` }, filename(row.filename)), h("span", { class: "sub narrow-only" }, [titleOf(row), row.taken_at?.slice(0, 10)].filter(Boolean).join(", "))] },
    { head: "Mean", class: "number", cell: (row) => quantity(row.mean) },
    { head: "What", class: "wide-only", cell: titleOf },
    { head: "Taken", class: "wide-only", cell: (row) => time(row.taken_at) },
    { head: "U₀", class: "number", cell: (row) => (row.u_o ? number(row.u_o.value, 2) : "–") },
    { head: "Calibration", cell: (row) => h("span", { class: "nowrap" }, h("a", { href: `/calibrations/${row.calibration.id}` }, `version ${row.calibration.version}`), " ", row.calibration.state === "published" ? null : tag(row.calibration.state)) },
    { head: "Flags", class: "number", cell: (row) => (row.flags.length ? h("span", { title: [...new Set(row.flags.map((each) => stateWords(each.flag)))].join(", ") }, String(new Set(row.flags.map((each) => each.flag)).size)) : "–") },
  ];
  return table(columns, rows, { caption: "Measurements" });
}

const REGIONS = {
  request: "the region drawn for this measurement",
  grid: "the outline of the surface with cells",
  frame: "the frame’s own region",
  campaign: "the campaign’s region",
  whole_frame: "the whole frame",
};

export const regionOf = ({ region_origin: origin }) => REGIONS[origin];

/** "luminance", "reflectance, band red", "NDVI". */
export function titleOf(measurement) {
  const { index, radiance } = measurement;
  if (index) return index.name === index.formula ? index.name : index.name.toUpperCase();
  if (radiance) return `radiance, band ${words(radiance)}`;
  const { measured_quantity: quantity, measurement_options: options } = methodOf(measurement.method);
  return options.includes("index") ? `${quantity}, band ${words(measurement.signal)}` : (quantity ?? words(measurement.method));
}
