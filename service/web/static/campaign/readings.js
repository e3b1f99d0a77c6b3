// The meter's readings: typed or pasted from a spreadsheet, listed by scene, withdrawn when mistyped.

import { all, post, send } from "../api.js";
import { byId, fill, h, may, table, toast } from "../dom.js";
import { counted, number, time } from "../format.js";
import { shorten } from "../shorten.js";
import { act, empty, load } from "../states.js";
import { field, select } from "./forms.js";
import { askForMeter, nameOfMeter } from "./meters.js";
import { wrong } from "./numbers.js";
import { UNITS, readSheet } from "./sheet.js";

export function readingsSection(state) {
  const list = h("div");
  const meters = { all: [] };
  const refresh = async () => {
    const [readings, known] = await Promise.all([state.readings(), all("/v1/meters")]);
    meters.all = known;
    return readings;
  };
  const draw = (readings) => {
    const standing = readings.filter((each) => !each.withdrawn_at).length;
    byId("readings-note").textContent = readings.length ? `${counted(standing, "reading")} of ${counted(new Set(readings.map((each) => each.scene)).size, "scene")}` : "";
    entry.offer(meters.all);
    return readings.length ? rows(readings, meters, again) : empty("No readings yet", "Luminance meter readings of each scene. Several readings of a scene are averaged.");
  };
  let shown = "";
  const again = () => load(list, refresh, draw);
  const entry = may("calibrate") ? entryPart(state, meters, async () => (await again(), state.touch())) : { element: null, offer() {} };
  // somebody else's readings: the campaign says how many there are
  state.on("campaign", () => {
    if (shown !== String(state.campaign.readings)) again();
    shown = String(state.campaign.readings);
  });
  again();
  shown = String(state.campaign.readings);
  return h("div", { class: "columns readings" }, list, entry.element);
}

function rows(readings, meters, again) {
  const collator = new Intl.Collator(undefined, { numeric: true });
  const sorted = [...readings].sort((a, b) => collator.compare(a.scene, b.scene) || a.quantity.localeCompare(b.quantity) * -1 || a.created_at.localeCompare(b.created_at));
  const meterOf = (each) => nameOfMeter(meters.all.find((meter) => meter.id === each.meter_id)) ?? "–";
  const entered = (each) => `${number(each.entered_value, 6)} ${each.entered_unit.replace("m2", "m²")}`;
  const columns = [
    { head: "Scene", header: true, class: "nowrap", cell: (each) => each.scene },
    { head: "Reading", class: "number", cell: (each) => [`${number(each.value, 5)} ${each.unit.replace("m2", "m²")}`, each.entered_unit === each.unit ? null : h("span", { class: "sub" }, entered(each)), each.meter_id ? h("span", { class: "sub narrow-only" }, meterOf(each)) : null] },
    { head: "Meter", class: "wide-only", cell: (each) => meterOf(each) },
    { head: "Taken", class: "wide-only", cell: (each) => (each.taken_at ? time(each.taken_at) : "–") },
    ...(may("calibrate") ? [{ head: h("span", { class: "hidden" }, "Withdraw"), cell: (each) => (each.withdrawn_at ? h("span", { class: "tag" }, "withdrawn") : h("button", { type: "button", class: "quiet", "aria-label": `Withdraw ${entered(each)} of ${each.scene}`, onclick: (event) => act(event.target, async () => (await send("DELETE", `/v1/readings/${each.id}`), await again())) }, "Withdraw")) }] : []),
  ];
  return shorten(sorted, (some) => table(columns, some, { caption: "Readings", row: (each) => ({ class: each.withdrawn_at ? "withdrawn" : "" }) }));
}

function entryPart(state, meters, after) {
  const text = h("textarea", { rows: "7", class: "mono", spellcheck: "false", placeholder: "level-1\t54.4\nlevel-1\t54.6\nlevel-2\t2.94" });
  const unit = select(Object.keys(UNITS).map((name) => [name, name.replace("m2", "m²")]));
  const meter = select([]);
  const told = h("div", { class: "sheet" });
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
  const draw = () => fill(told, text.value.trim() ? preview(read()) : null);
  text.addEventListener("input", draw);
  unit.addEventListener("change", () => {
    byHand &&= meters.all.find((each) => each.id === meter.value)?.kind === UNITS[unit.value];
    draw();
    offer(meters.all);
  });
  const add = async () => {
    const { rows: lines, faults } = read();
    if (faults.length) throw wrong(faults.map(({ line, text: why }) => `Line ${line}: ${why}`).join(" "));
    if (!lines.length) throw wrong("Type or paste a line such as: level-1 54.4");
    const query = meter.value ? `?meter_id=${encodeURIComponent(meter.value)}` : "";
    await post(`${state.path}/readings${query}`, lines.map((line) => line.reading)).catch((error) => {
      throw withLines(error, lines);
    });
    toast(`${counted(lines.length, "reading")} recorded.`);
    text.value = "";
    draw();
    await after();
  };
  const element = h(
    "form",
    { class: "card", onsubmit: (event) => (event.preventDefault(), act(event.submitter, add)) },
    h("h3", {}, "Add readings"),
    field("Lines", text, "One reading per line, typed or pasted from a spreadsheet: scene, value, and optionally unit and time. With a header line the columns may be in any order."),
    told,
    h("div", { class: "fields" }, field("Unit if none is given", unit), field("Meter", meter)),
    h("p", { class: "actions" }, h("button", { class: "primary", type: "submit" }, "Add"), h("button", { type: "button", class: "quiet", onclick: async () => {
      const made = await askForMeter();
      if (!made) return;
      meters.all = await all("/v1/meters");
      byHand = true;
      offer(meters.all);
      meter.value = made.id;
    } }, "Register a meter…")),
  );
  return { element, offer };
}

function preview({ rows: lines, faults }) {
  const good = lines.length ? h("p", { class: "small" }, h("span", { class: "tag good" }, `${lines.length} understood`), " ", lines.slice(0, 3).map(({ reading }) => `${reading.scene}: ${number(reading.value, 6)} ${reading.unit.replace("m2", "m²")}`).join(", "), lines.length > 3 ? ", …" : "") : null;
  const bad = faults.length ? h("ul", { class: "plain faults", role: "alert" }, faults.slice(0, 8).map(({ line, text }) => h("li", {}, h("strong", {}, `Line ${line}: `), text))) : null;
  return [good, bad];
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
