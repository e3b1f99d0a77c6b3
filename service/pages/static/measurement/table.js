// Measurements in a table, a line each.

import { filename, h, table } from "../dom.js";
import { number, quantity, stateWords, tag, time } from "../format.js";
import { titleOf } from "./words.js";

/** `first`: a column before the others. */
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
