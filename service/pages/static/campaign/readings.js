// The meter's readings, pasted from a spreadsheet; single ones are typed in the grid.

import { byId, fill, h, may } from "../dom.js";
import { counted, number } from "../format.js";
import { act } from "../states.js";
import { about, field, select } from "./forms.js";
import { askForMeter, nameOfMeter } from "./meters.js";
import { wrong } from "./numbers.js";
import { UNITS, readSheet } from "./sheet.js";

/** What is pasted goes into the grid, where each reading stands in the row of its scene. */
export function readingsSection(state) {
  const { book } = state;
  const note = () => {
    const standing = book.readings.filter((each) => !each.withdrawn_at);
    byId("readings-note").textContent = standing.length ? `${counted(standing.length, "reading")} of ${counted(new Set(standing.map((each) => each.scene)).size, "scene")}` : "";
  };
  book.addEventListener("change", note);
  note();
  if (!may("calibrate")) return h("p", { class: "muted" }, "Readings stand in the rows of the grid.");
  const entry = entryPart(state, book);
  book.addEventListener("change", () => entry.offer(book.meters));
  entry.offer(book.meters);
  return entry.element;
}

function entryPart(state, book) {
  const text = h("textarea", { rows: "7", class: "mono", spellcheck: "false", placeholder: "level-1\t54.4\nlevel-1\t54.6\nlevel-2\t2.94" });
  const unit = select(Object.keys(UNITS).map((name) => [name, name.replace("m2", "m²")]));
  const meter = select([]);
  const told = h("div", { class: "preview-lines" });
  let byHand = false;
  meter.addEventListener("change", () => (byHand = true));
  const offer = (known) => {
    // of several of a kind nobody but the reader of the meter knows which it was
    const ofKind = known.filter((each) => each.kind === UNITS[unit.value]);
    const kept = byHand ? meter.value : ofKind.length === 1 ? ofKind[0].id : "";
    fill(meter, h("option", { value: "" }, "None, or as in the lines"), known.map((each) => h("option", { value: each.id }, `${nameOfMeter(each)} (${each.kind}${each.certificate ? "" : ", no certificate"})`)));
    meter.value = kept;
  };
  const read = () => readSheet(text.value, { unit: unit.value });
  const draw = () => fill(told, text.value.trim() ? preview(read(), state.scenes) : null);
  text.addEventListener("input", draw);
  unit.addEventListener("change", () => {
    byHand &&= book.meters.find((each) => each.id === meter.value)?.kind === UNITS[unit.value];
    draw();
    offer(book.meters);
  });
  const add = async () => {
    const { rows: lines, faults } = read();
    if (faults.length) throw wrong(faults.map(({ line, text: why }) => `Line ${line}: ${why}`).join(" "));
    if (!lines.length) throw wrong("Type or paste a line such as: level-1 54.4");
    const query = meter.value ? `?meter_id=${encodeURIComponent(meter.value)}` : "";
    await book.record(lines.map((line) => line.reading), query).catch((error) => {
      throw withLines(error, lines);
    });
    text.value = "";
    draw();
  };
  const element = h(
    "form",
    { class: "card", onsubmit: (event) => (event.preventDefault(), act(event.submitter, add)) },
    h("h3", {}, "Add readings"),
    field("Lines", text, "One reading per line, typed or pasted from a spreadsheet: scene, value, and optionally unit and time (UTC). With a header line the columns may be in any order.", "Lines that cannot be read are listed with the reason; nothing is recorded until all can be read."),
    told,
    h("div", { class: "fields" }, field("Unit if none is given", unit, null, about("NewReading", "unit")), field("Meter", meter, null, about("NewReading", "meter_id"))),
    h("p", { class: "actions" }, h("button", { class: "primary", type: "submit" }, "Add"), h("button", { type: "button", class: "quiet", onclick: async () => {
      const made = await askForMeter();
      if (!made) return;
      byHand = true;
      book.meet([...book.meters, made]);
      meter.value = made.id;
    } }, "Register a meter…")),
  );
  return { element, offer };
}

function preview({ rows: lines, faults }, scenes) {
  const good = lines.length ? h("p", { class: "small" }, h("span", { class: "tag good" }, `${lines.length} understood`), " ", lines.slice(0, 3).map(({ reading }) => `${reading.scene}: ${number(reading.value, 6)} ${reading.unit.replace("m2", "m²")}`).join(", "), lines.length > 3 ? ", …" : "") : null;
  const bad = faults.length ? h("ul", { class: "plain faults", role: "alert" }, faults.slice(0, 8).map(({ line, text }) => h("li", {}, h("strong", {}, `Line ${line}: `), text))) : null;
  const strange = scenes.length ? [...new Set(lines.map(({ reading }) => reading.scene))].filter((name) => !scenes.includes(name)) : [];
  const unseen = strange.length ? h("p", { class: "small" }, h("span", { class: "tag warn" }, "no frames"), ` of ${strange.slice(0, 3).join(", ")}${strange.length > 3 ? `, and ${strange.length - 3} more` : ""}. Frames have: ${scenes.slice(0, 12).join(", ")}.`) : null;
  return [good, bad, unseen];
}

/** The API names the item by its place in the list; people know the line. */
function withLines(error, lines) {
  const faults = Object.entries(error.fields ?? {}).map(([name, message]) => {
    const [at, ...rest] = name.split(".");
    return lines[Number(at)] ? `Line ${lines[Number(at)].line}: ${rest.join(".")} ${message}` : `${name} ${message}`;
  });
  if (faults.length) error.message = faults.join(". ");
  return error;
}
