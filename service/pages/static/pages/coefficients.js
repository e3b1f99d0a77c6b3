// Coefficients in time: what was in force at a time, as known at a time; the address holds both.

import { all, get } from "../api.js";
import { ask } from "../ask.js";
import { byId, empty, failed, fill, h, load, mark, svg, table, toast } from "../dom.js";
import { counted, day, hasZone, quantity, unit } from "../format.js";
import { METHODS, coefficientLabel, headlineOf, holdsFor } from "../methods.js";
import { plot } from "../plots.js";

const id = document.querySelector("main").dataset.cameraId;
const PARTS = ["name", "iso", "f_number", "band", "channel", "model"];
const DAY_MS = 86400e3;
const UNITS_MS = { h: 3600e3, d: DAY_MS, w: 7 * DAY_MS, M: 30.44 * DAY_MS, y: 365.25 * DAY_MS };
const said = new URL(location.href).searchParams;
const state = { method: said.get("method"), at: said.get("at") ?? "now", known_at: said.get("known_at") ?? "now", of: said.get("of") };
let versions = [];

offerTimes();

async function start() {
  try {
    const { items } = await get(`/v1/cameras/${id}/decisions`);
    const methods = METHODS.filter(({ name }) => items.some((each) => each.act === "published" && each.method === name));
    if (!methods.length) return void fill(document.querySelector("#times").parentElement, byId("main").querySelector(".head"), empty("Nothing was published", "Published calibrations of this camera appear here.", h("a", { class: "button", href: `/cameras/${id}` }, "Camera")));
    state.method = methods.some(({ name }) => name === state.method) ? state.method : methods[0].name;
    fill(byId("methods"), methods.map(({ name, label }) => h("a", { href: `?${new URLSearchParams({ method: name, at: state.at, known_at: state.known_at })}`, "aria-current": name === state.method ? "page" : null }, label)));
    await draw();
  } catch (error) {
    fill(byId("answer"), failed(error, start));
  }
}

/** The instant that a text names: a date, a date with a time, now, or a time before now; NaN where none. */
function instantOf(text) {
  const [, count, unit] = /^now-(\d+)([hdwMy])$/.exec(text) ?? [];
  if (unit) return Date.now() - count * UNITS_MS[unit];
  if (text === "now") return Date.now();
  const [, date, clock] = /^(\d{4}-\d\d-\d\d)(?:[T ](\d\d:\d\d(?::\d\d(?:\.\d+)?)?))?(?: ?UTC|Z)?$/.exec(text) ?? [];
  return date ? Date.parse(`${date}T${clock ?? "00:00"}Z`) : NaN;
}

const iso = (name) => new Date(instantOf(state[name])).toISOString();
const written = (ms) => new Date(ms).toISOString().slice(0, 16).replace("T", " ");

function offerTimes() {
  byId("times").addEventListener("submit", (event) => event.preventDefault());
  for (const name of ["at", "known_at"]) {
    const field = byId(name);
    field.addEventListener("change", () => {
      const known = Number.isFinite(instantOf(field.value.trim()));
      field.setCustomValidity(known ? "" : "A date, a date and time, now, or now-30d");
      field.reportValidity();
      if (known) choose({ [name]: field.value.trim() });
    });
  }
  byId("reset").addEventListener("click", () => choose({ at: "now", known_at: "now", of: null }));
  byId("of").addEventListener("change", ({ target }) => choose({ of: target.value }));
  const copy = (name, text) => byId(name).addEventListener("click", async () => (await navigator.clipboard.writeText(text()), toast("Copied")));
  copy("copy-link", () => `${location.origin}${location.pathname}?${new URLSearchParams({ method: state.method, at: iso("at"), known_at: iso("known_at"), of: state.of })}`);
  copy("copy-request", () => location.origin + byId("request").textContent.replaceAll(/\s+/g, ""));
  document.addEventListener("keydown", (event) => {
    if (event.target.matches("input, select, textarea") || !["[", "]"].includes(event.key)) return;
    const starts = versions.flatMap((each) => [...each.in_force, ...each.revoked_from]).map((each) => Date.parse(each.valid_from)).sort((a, b) => a - b);
    const now = instantOf(state.at);
    const next = event.key === "]" ? starts.find((each) => each > now) : starts.findLast((each) => each < now);
    if (next !== undefined) choose({ at: written(next) });
  });
}

function drawQuick() {
  const offer = (name, options) => fill(byId(`${name}-quick`), options.map(([label, value, action]) => h("button", { type: "button", "aria-pressed": String(state[name] === value), onclick: action ?? (() => choose({ [name]: value })) }, label)));
  offer("at", [["Now", "now"], ["30 days ago", "now-30d"], ["1 year ago", "now-1y"], ["A measurement…", null, askMeasurement]]);
  offer("known_at", [["Now", "now"], ["The same time", state.at === "now" ? null : state.at, () => choose({ known_at: state.at })], ["1 year ago", "now-1y"]]);
}

async function askMeasurement() {
  const { items } = await get(`/v1/measurements?camera_id=${id}&limit=100`);
  // a clock without a zone is looked up as if it showed UTC, wherever the browser is
  const timed = items.filter((each) => each.taken_at && each.created_at).map((each) => ({ ...each, taken: Date.parse(hasZone(each.taken_at) ? each.taken_at : `${each.taken_at}Z`) }));
  if (!timed.length) return toast("No measurement with this camera states when its frame was taken.");
  await ask({
    title: "A measurement",
    fields: [{ name: "measurement", label: "Measurement", help: "Sets both times: when its frame was taken, and what was known when it was measured.", options: timed.map((each) => [each.id, `${each.filename}, ${written(each.taken)}`]) }],
    submit: "Take its times",
    action: ({ measurement }) => {
      const found = timed.find((each) => each.id === measurement);
      return choose({ at: written(found.taken), known_at: new Date(found.created_at).toISOString() });
    },
  });
}

function choose(changes) {
  Object.assign(state, changes);
  return show();
}

// one after the other: an answer that was asked for earlier never stands over a later one
let shown = start();
const show = () => (shown = shown.then(draw));

async function draw() {
  const known = iso("known_at");
  const at = iso("at");
  for (const field of [byId("at"), byId("known_at")]) if (field !== document.activeElement) field.value = state[field.id]; // what is being typed stays
  drawQuick();
  await load(byId("answer"),
    async () => {
      versions = (await validity(known)).items;
      offerCoefficients();
      history.replaceState(null, "", `?${new URLSearchParams({ method: state.method, at: state.at, known_at: state.known_at, of: state.of })}`);
      const then = at < known && !holding(versions, at) ? holding((await validity(at)).items, at) : undefined;
      const used = then ? (await all(`/v1/measurements?calibration_id=${then.calibration_id}`)).length : 0;
      return [at, known, then, used];
    },
    drawAnswer,
  );
  load(byId("versions"), () => versions, drawVersions);
  const request = `/v1/cameras/${id}/coefficients?method=${state.method}&at=${at}&known_at=${known}`;
  byId("request").textContent = request.replace("?", "\n    ?").replaceAll("&", "\n    &");
  byId("csv").href = `/v1/series/coefficients?${new URLSearchParams({ camera_id: id, method: state.method, format: "csv" })}`;
  byId("values-title").textContent = `${labelOfWanted()} in time`;
  const query = new URLSearchParams({ method: state.method, at, known_at: known, ...wanted() });
  const held = [...document.querySelectorAll(".cursor")].indexOf(document.activeElement);
  await Promise.all(["values", "lives"].map((part) => plot(byId(part), `/plots/cameras/${id}/${part}?${query}`, (chart) => drawCursors(chart, { at: Date.parse(at), known_at: Date.parse(known) }))));
  // the same line, drawn anew
  if (held >= 0 && document.activeElement === document.body) document.querySelectorAll(".cursor")[held]?.focus();
}

const validity = (known) => get(`/v1/cameras/${id}/validity?${new URLSearchParams({ method: state.method, known_at: known })}`);
const within = ({ valid_from: from, valid_to: to }, at) => Date.parse(from) <= Date.parse(at) && (!to || Date.parse(at) < Date.parse(to));
const holding = (found, at) => found.find((each) => each.in_force.some((period) => within(period, at)) && rowOf(each)) ?? found.find((each) => each.in_force.some((period) => within(period, at)));

const wanted = () => Object.fromEntries(Object.entries(JSON.parse(state.of)).filter(([, value]) => value !== null));
const keyOf = (row) => JSON.stringify(Object.fromEntries(PARTS.map((name) => [name, row[name] ?? null])));
const rowOf = (version) => version?.coefficients.find((row) => keyOf(row) === state.of);

function offerCoefficients() {
  const rows = new Map(versions.flatMap((each) => each.coefficients).map((row) => [keyOf(row), row]));
  const first = headlineOf(state.method);
  const sorted = [...rows].sort(([, a], [, b]) => (b.name === first) - (a.name === first));
  if (!rows.has(state.of)) state.of = sorted[0]?.[0] ?? keyOf({ name: first });
  fill(byId("of"), sorted.map(([key, row]) => h("option", { value: key, selected: key === state.of }, [coefficientLabel(state.method, row.name), holdsFor(row)].filter(Boolean).join(", "))));
}

function labelOfWanted() {
  const row = JSON.parse(state.of);
  return [coefficientLabel(state.method, row.name), holdsFor(row)].filter(Boolean).join(", ");
}

const named = (version) => h("a", { href: `/calibrations/${version.calibration_id}` }, `version ${version.version}`);

function drawAnswer([at, known, then, used]) {
  const found = holding(versions, at);
  const when = `On ${written(Date.parse(at))} UTC, as known ${state.known_at === "now" ? "now" : `on ${written(Date.parse(known))} UTC`}: `;
  if (found) {
    const row = rowOf(found);
    return h("div", { class: "answer" }, mark("good"), h("p", {}, h("strong", {}, when, named(found), " is in force. "), row ? [`${labelOfWanted()} = `, quantity(row), " (± u)."] : `It has no ${labelOfWanted()}.`), h("p", { class: "more" }, `Published ${day(found.published_at.at(-1))} by ${found.published_by_name ?? found.published_by}: ${found.reason}`));
  }
  const revoked = versions.find((each) => each.revoked_from.some((period) => within(period, at)));
  const near = nearest(at);
  return h("div", { class: "answer warn" },
    mark("warn"),
    h("p", {}, h("strong", {}, when, "no version is in force. "), revoked ? `Version ${revoked.version} was revoked on ${day(revoked.revoked_at)}: “${revoked.revoked_reason}”` : null),
    h("p", { class: "more" },
      then ? ["As known on that day, ", named(then), " was in force", rowOf(then) ? [": ", quantity(rowOf(then))] : "", ". ", used ? [h("strong", {}, `${counted(used, "measurement")} `), used === 1 ? "was" : "were", " made with it. ", h("a", { href: `/measurements?camera_id=${id}` }, "Show the camera's measurements"), ". "] : null] : null,
      near.length ? ["Nearest: ", near.map(([version, words], place) => [place ? " and " : "", named(version), ` (${words})`]), "."] : null,
    ),
  );
}

/** The versions in force before and after a time at which none is. */
function nearest(at) {
  const periods = versions.flatMap((version) => version.in_force.map((period) => ({ version, ...period })));
  const before = periods.filter((each) => each.valid_to && Date.parse(each.valid_to) <= Date.parse(at)).sort((a, b) => Date.parse(b.valid_to) - Date.parse(a.valid_to))[0];
  const after = periods.filter((each) => Date.parse(each.valid_from) > Date.parse(at)).sort((a, b) => Date.parse(a.valid_from) - Date.parse(b.valid_from))[0];
  return [before && [before.version, `until ${day(before.valid_to)}`], after && [after.version, `from ${day(after.valid_from)}`]].filter(Boolean);
}

function drawVersions() {
  if (!versions.length) return empty("No versions", "Nothing had been published then.");
  const at = iso("at");
  const current = holding(versions, at);
  const kind = (each) => (each.revoked_at ? ["bad", "Revoked"] : each === current ? ["good", "In force"] : ["out", "Not in force at this time"]);
  const columns = [
    { head: "Version", header: true, cell: (each) => h("span", { class: "nowrap" }, mark(...kind(each)), " ", named(each)) },
    { head: "Valid", cell: ({ in_force: held, revoked_from: lost }) => (held.length + lost.length ? [...held, ...lost].map((each) => h("div", { class: "nowrap" }, `${day(each.valid_from)} – ${each.valid_to ? day(each.valid_to) : "open"}`)) : "replaced") },
    { head: versions.some((each) => rowOf(each)?.unit !== "1") ? `Value ± u [${unit(versions.map(rowOf).find(Boolean)?.unit ?? "1")}]` : "Value ± u", class: "number", cell: (each) => (rowOf(each) ? quantity({ ...rowOf(each), unit: "1" }) : "–") },
    { head: "Decided", cell: (each) => h("span", {}, each.revoked_at ? `revoked ${day(each.revoked_at)}` : `published ${day(each.published_at.at(-1))}`, h("span", { class: "sub" }, each.revoked_at ? (each.revoked_by_name ?? each.revoked_by) : (each.published_by_name ?? each.published_by))) },
  ];
  return table(columns, versions, { caption: "Versions", stack: true, row: (each) => ({ "aria-current": each === current ? "true" : null }) });
}

function drawCursors(chart, times) {
  chart.setAttribute("role", "group");
  const box = Object.fromEntries(["x", "y", "width", "height"].map((name) => [name, Number(chart.querySelector(".box").getAttribute(name))]));
  const [low, high] = [chart.dataset.low, chart.dataset.high].map((each) => 1000 * each);
  for (const [name, label] of [["at", "in force at"], ["known_at", "known at"]]) {
    let ms = Math.min(high, Math.max(low, times[name]));
    const line = svg("g", { class: `cursor${name === "at" ? "" : " known"}`, role: "slider", tabindex: "0", "aria-label": label, "aria-valuemin": Math.round(low / DAY_MS), "aria-valuemax": Math.round(high / DAY_MS) });
    const place = () => {
      const x = box.x + ((ms - low) / (high - low)) * box.width;
      line.setAttribute("aria-valuenow", Math.round(ms / DAY_MS));
      line.setAttribute("aria-valuetext", `${written(ms)} UTC`);
      const flag = Math.min(box.x + box.width - 72, Math.max(box.x, x - 36));
      const ends = { x1: x, x2: x, y1: box.y, y2: box.y + box.height };
      const text = svg("text", { x: flag + 36, y: box.y + 12 + (name === "at" ? 0 : 18), class: "mid" });
      text.textContent = label;
      const named = chart.parentElement.id === "values" ? [svg("rect", { x: flag, y: box.y + (name === "at" ? 0 : 18), width: 72, height: 17, rx: 3 }), text] : [];
      line.replaceChildren(svg("line", ends), svg("line", { ...ends, class: "grip" }), ...named);
    };
    const settle = () => choose({ [name]: written(ms) });
    line.addEventListener("keydown", (event) => {
      const days = { ArrowLeft: -1, ArrowRight: 1, PageDown: -30, PageUp: 30 }[event.key];
      if (!days) return;
      event.preventDefault();
      ms = Math.min(high, Math.max(low, instantOf(state[name]) + days * (event.shiftKey ? 30 : 1) * DAY_MS));
      settle();
    });
    line.addEventListener("pointerdown", (event) => line.setPointerCapture(event.pointerId));
    line.addEventListener("pointermove", (event) => {
      if (!line.hasPointerCapture(event.pointerId)) return;
      const shown = chart.querySelector(".box").getBoundingClientRect();
      ms = low + Math.min(1, Math.max(0, (event.clientX - shown.left) / shown.width)) * (high - low);
      place();
    });
    line.addEventListener("pointerup", settle);
    place();
    chart.append(line);
  }
}
