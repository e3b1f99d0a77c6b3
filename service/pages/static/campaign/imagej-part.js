// Import and export of ImageJ macro lines and .roi files.

import { fill, h, may } from "../dom.js";
import { act, wrong } from "../states.js";
import { readMacro, readRoi, writeMacro, writeRoi } from "./imagej.js";

export function imagejPart(editor, frameOf) {
  const text = h("textarea", { class: "mono", rows: "3", spellcheck: "false", "aria-label": "ImageJ macro", "aria-describedby": "imagej-hint", placeholder: "makePolygon(2200,1600,3100,1600,3100,2300,2200,2300);" });
  const show = () => {
    if (document.activeElement !== text) text.value = writeMacro(editor.regions.filter((region) => region.closed));
  };
  editor.addEventListener("settled", show);
  show();
  const inside = (regions) => {
    const [width, height] = editor.size;
    for (const { points } of regions) {
      const out = points.find(([x, y]) => x < 0 || y < 0 || x > width || y > height);
      if (out) throw wrong(`The corner (${out.join(", ")}) lies outside the frame of ${width} × ${height} pixels.`);
    }
    editor.take(regions);
  };
  const told = (read) => {
    try {
      return read();
    } catch (error) {
      throw error.code ? error : wrong(error.message);
    }
  };
  const files = h("input", { type: "file", hidden: true, multiple: true, accept: ".roi,.ijm,.txt", "aria-label": "ImageJ file", onchange: () => act(open, load) });
  async function load() {
    const regions = [];
    for (const file of files.files) {
      const data = await file.arrayBuffer();
      const found = told(() => (file.name.toLowerCase().endsWith(".roi") ? [readRoi(data)] : readMacro(new TextDecoder().decode(data))));
      regions.push(...found.map((region, index) => ({ ...region, name: region.name ?? (files.files.length + found.length > 2 ? `${file.name.replace(/\.\w+$/, "")}${index || ""}` : "") })));
    }
    files.value = "";
    inside(regions.length === 1 ? [{ ...regions[0], name: "" }] : regions);
  }
  const open = h("button", { type: "button", onclick: () => files.click() }, "Open .roi or macro");
  const links = h("span", { class: "actions" });
  const drawLinks = () => fill(links, h("button", { type: "button", disabled: !editor.region.closed, onclick: () => save(editor.region, frameOf()) }, "Save .roi"));
  editor.addEventListener("settled", drawLinks);
  drawLinks();
  return h(
    "details",
    { class: "imagej" },
    h("summary", {}, "ImageJ: macro and .roi"),
    h("p", { class: "hint", id: "imagej-hint" }, "Lines of ImageJ’s macro recorder, such as makeRectangle, makeOval or makePolygon, in pixels of the frame. A line is a part of the region."),
    text,
    h("p", { class: "actions" }, may("calibrate") ? [h("button", { type: "button", onclick: (event) => act(event.target, async () => inside(told(() => readMacro(text.value)))) }, "Use this macro"), open, files] : null, links),
  );
}

function save(region, frame) {
  const address = URL.createObjectURL(new Blob([writeRoi(region)], { type: "application/octet-stream" }));
  h("a", { href: address, download: `${region.name || frame.filename.replace(/\.\w+$/, "")}.roi` }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}
