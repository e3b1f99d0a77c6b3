// One road: its verdict first, what it lacks, figures with U, the map, control points and the grid.

import { get, patch, put, runJob } from "../api.js";
import { ask } from "../ask.js";
import { drawFindings, small } from "../causes.js";
import { act, budgetBar, byId, empty, fill, h, load, mark, may, svg, table } from "../dom.js";
import { exposureTime, fixed, number, percent, stateWords, unit, withUncertainty, words } from "../format.js";
import { MARKS, said, typePoints } from "./list.js";
import { axisOf, drawMap } from "./map.js";
import { drawSite } from "./site.js";

const { roadId } = document.querySelector("main").dataset;
const own = `/v1/roads/${roadId}`;
const NAMES = { e_av: ["Average", "E", "av"], e_min: ["Minimum", "E", "min"], u_0: ["Uniformity", "U", "0"], average_to_min: ["Average to minimum", "E", "av/min"], eir: ["Edge ratio", "EIR", ""], pdi: ["Power density", "D", "P"], l_av: ["Luminance", "L", "av"], u_o: ["Overall uniformity", "U", "o"], u_l: ["Longitudinal uniformity", "U", "l"], f_ti: ["Threshold increment", "f", "TI"] };
const [GUARD, mayChange] = [1.645, may("calibrate")];
let [road, rules, saveSite] = [null, [], () => {}];

const sign = (figure) => [NAMES[figure][1] || words(figure), h("sub", {}, NAMES[figure][2])];
/** "U_0 = 0.41" with the 0 set lower. */
const lower = (text) => text.split(/_(\w+)/).map((part, at) => (at % 2 ? h("sub", {}, part) : part));
const unitOf = (figure) => (/^e_(av|min)$/.test(figure) ? " lx" : "");

byId("hide")?.addEventListener("click", hide);
byId("type")?.addEventListener("click", async () => (await typePoints(own)) && show());
byId("evaluate")?.addEventListener("click", (event) => act(event.target, () => evaluate()));
show().then(() => road && (saveSite = drawSite(road, show)));

async function evaluate(changed) {
  await saveSite(await changed);
  await runJob(`${own}/evaluate`, undefined, byId("progress"), "Evaluating");
  await show();
}

async function show() {
  const asked = (async () => {
    [road, { items: rules }] = await Promise.all([get(own), get("/v1/road-rules")]);
    const last = road.results.at(-1);
    return last ? get(last.link) : null;
  })();
  await Promise.all([
    load(byId("verdict"), () => asked, drawVerdict),
    load(byId("points"), () => asked, drawPoints),
    load(byId("grid"), () => asked, (result) => (result ? drawGrid(result) : empty("No figures yet", ""))),
    load(byId("flags"), () => asked, (result) => (result ? drawFindings(result.findings) : empty("No flags yet", ""))),
  ]);
  const result = await asked.catch(() => null);
  byId("answer").hidden = !result;
  if (result) drawAnswer(result);
}

function drawAnswer(result) {
  const first = result.frames[0];
  fill(byId("under"), [`${result.frames.length} frames at ${exposureTime(first.exposure_time_s)}, at most ${number(result.grid.view_deg, 2)}° off nadir`, `${first.camera}, K version ${first.calibration_version}`, `${stateWords(result.stated.conditions?.lamp_kind ?? "lamp not stated")}, ${result.stated.conditions?.surface ?? "surface not stated"}`, result.as_found ? "as found" : "maintained"].map((text) => h("span", {}, text)));
  fill(byId("exports"), [["report.pdf", "Report (PDF)"], ["points.csv", "CSV"], ["points.geojson", "GeoJSON"]].map(([name, text]) => h("a", { class: "button", href: result.links[name], download: name }, text)));
  fill(byId("figures"), h("dl", { class: "road-figures" }, result.figures.map((each) => h("div", {}, h("dt", {}, NAMES[each.figure][0], " ", sign(each.figure)), h("dd", {}, h("b", {}, withUncertainty(each.value, each.expanded_uncertainty)), each.unit === "1" ? "" : ` ${unit(each.unit)}`)))));
  drawLimits(result);
  drawProspects(result);
  if (result.map) drawMap(result);
  const rows = result.budget.map((each) => ({ source: each.source, share: each.variance_share, said: percent(each.u_rel) }));
  fill(byId("budget"), budgetBar(rows));
}

function drawVerdict(result) {
  if (!result) return empty("Not evaluated yet", road.frames.length ? "Evaluate the road: its frames are measured with the calibration in force." : "The road has no frames: state them with their marks.");
  const [verdict, why] = result.said;
  const wrong = result.control.filter((each) => each.state === "differs");
  return [
    h("div", { class: `verdict-line ${MARKS[result.verdict]}` }, mark(MARKS[result.verdict]), h("p", {}, h("strong", {}, verdict), " ", lower(why))),
    wrong.length ? h("ul", { class: "causes" }, wrong.map(cause)) : null,
  ];
}

function cause(point) {
  const text = `${point.name} differs from the map by ${percent(point.difference_rel)}.`;
  const where = `${number(point.value, 3)} against ${number(point.without_it, 3)} of the map without it. The figures here are without it.`;
  return h("li", {}, mark("bad"), h("p", {}, h("strong", {}, text), h("span", { class: "where" }, ` ${where}`)), mayChange ? h("span", { class: "actions" }, small(`Leave out ${point.name}…`, () => leaveOut(point.name))) : null);
}

const leaveOut = (name) => ask({
  title: `Leave out ${name}`,
  fields: [{ name: "left_out", label: "Reason", hint: "Such as: receiver in shadow.", help: "The point stays in the record, and no figure uses it; the report prints the reason.", maxlength: 200 }],
  submit: "Leave out",
  action: (changes) => changePoint(name, changes),
});

function hide() {
  return ask({
    title: "Hidden points",
    fields: [{ name: "hidden", label: "Points", type: "textarea", required: false, value: road.hidden.join(", "), hint: `Such as ${road.grid[0].name}: lane, row across and column along.`, help: "What a car or a tree hides is predicted from its neighbours, and counted in the report." }],
    submit: "Save",
    action: ({ hidden = "" }) => evaluate(patch(own, { hidden: hidden.split(/[,\n]/).map((name) => name.trim()).filter(Boolean) })),
  });
}

function changePoint(name, changes) {
  const points = road.points.map((each) => (each.name === name ? Object.fromEntries(Object.entries({ ...each, ...changes }).filter(([, value]) => value !== null)) : each));
  return evaluate(put(`${own}/points`, points));
}

function drawLimits(result) {
  const { requirement } = result.stated;
  const rule = rules.find(({ name }) => name === requirement.rule);
  const choose = (label, values, chosen, name) =>
    h("label", { class: "field" }, h("span", {}, label), h("select", { title: label, disabled: !mayChange, onchange: (event) => act(event.target, () => change({ [name]: event.target.value })) }, values.map(([value, text]) => h("option", { value, selected: value === chosen }, text))));
  fill(byId("limits"),
    h("div", { class: "pair-fields" }, choose("Class", (rule?.classes ?? []).map(({ name }) => [name, name]), requirement.road_class, "road_class"), choose("Decision rule", [["guarded", "Guarded, 5 %"], ["simple", "Simple"], ["shared_risk", "Shared risk"]], requirement.decision ?? "guarded", "decision")),
    h("dl", { class: "limits" }, result.criteria.map((each) => drawLimit(each, result.figures.find(({ figure }) => figure === each.figure)))),
    h("p", { class: "caption" }, `${requirement.rule}${requirement.confirmed ? `, confirmed by ${requirement.confirmed}` : ", figures not confirmed"}. ${rule?.read ?? ""}`),
  );
}

/** Further control points, should the values stay. */
function drawProspects(result) {
  const rows = result.criteria.flatMap(({ figure, prospects = [] }) => prospects.map((each) => ({ ...each, figure })));
  byId("decide").hidden = !rows.length;
  const columns = [
    { head: "Figure", header: true, cell: ({ figure }) => sign(figure) },
    { head: "Control points", class: "number", cell: ({ points }) => `${points} more` },
    { head: "U, 95 %", class: "number", cell: ({ expanded_uncertainty: u, figure }) => `${number(u, 2)}${unitOf(figure)}` },
    { head: "Then", cell: ({ is_decided: yes }) => h("span", {}, mark(yes ? "good" : "open"), yes ? " decided" : " not decided") },
  ];
  fill(byId("prospects"), table(columns, rows, { caption: "What would decide it", stack: true }));
}

const change = (changes) => evaluate(patch(own, { requirement: { ...road.requirement, ...changes } }));

function drawLimit(criterion, figure) {
  const limits = [["at least", criterion.at_least], ["at most", criterion.at_most]].filter(([, value]) => value !== undefined);
  const needed = criterion.needed_u ? h("dd", { class: "small muted limit-cell" }, `U of ${number(criterion.needed_u, 2)} would decide it`) : null;
  return h("div", {}, h("dt", {}, sign(criterion.figure), " ", limits.map(([text, value]) => `${text} ${number(value)}${unitOf(criterion.figure)}`).join(", ")), h("dd", {}, said(criterion.verdict)), figure ? h("dd", { class: "limit-cell" }, strip(criterion, figure)) : null, needed);
}

/** Red beyond the limit, amber up to where the guarded rule accepts, green behind it; the value with its interval. */
function strip({ at_least: least, at_most: most }, { value, low, high, standard_uncertainty: u }) {
  const limit = least ?? most;
  const from = Math.min(limit, low) * 0.9;
  const to = Math.max(limit, high) * 1.1;
  const x = (at) => 6 + (296 * (Math.min(Math.max(at, from), to) - from)) / (to - from);
  const guard = least === undefined ? limit - GUARD * u : limit + GUARD * u;
  const zone = (name, one, other) => svg("rect", { class: name, x: Math.min(x(one), x(other)), y: 8, width: Math.abs(x(one) - x(other)), height: 12 });
  const [bad, good] = least === undefined ? [to, from] : [from, to];
  const label = svg("text", { x: x(limit), y: 36, "text-anchor": "middle" });
  label.append(`${number(limit)} needed`);
  return svg("svg", { class: "limit-strip", viewBox: "0 0 308 40", role: "img", "aria-label": `value ${number(value, 3)}, limit ${number(limit)}` }, zone("zone-no", bad, limit), zone("zone-guard", limit, guard), zone("zone-ok", guard, good), svg("path", { class: "limit-line", d: `M${x(limit)} 3V25` }), svg("path", { class: "value-line", d: `M${x(low)} 14H${x(high)}M${x(low)} 10v8M${x(high)} 10v8` }), svg("circle", { class: "value-dot", cx: x(value), cy: 14, r: 4 }), label);
}

function drawPoints(result) {
  if (!road.points.length) return empty("No control points yet", "Read at least four with a lux meter, below and between the lamps, and enter the readings here.");
  const found = new Map((result?.control ?? []).map((each) => [each.name, each]));
  const state = (point) => found.get(point.name)?.state ?? "not_evaluated";
  const columns = [
    { head: "Point", header: true, cell: (point) => point.name },
    { head: "Along, across", class: "number", cell: (point) => `${fixed(point.x_m, 1)}, ${fixed(point.y_m, 1)} m` },
    { head: "Meter", class: "number", cell: (point) => `${point.values.map((value) => number(value, 3)).join("; ")} ${unit(point.unit)}` },
    { head: "Map without it", class: "number", cell: (point) => number(found.get(point.name)?.without_it, 3) },
    { head: "Difference", class: "number", cell: (point) => (found.get(point.name)?.difference_rel === undefined ? "–" : percent(found.get(point.name).difference_rel)) },
    { head: "State", cell: (point) => h("span", {}, mark({ agrees: "good", differs: "bad", left_out: "out" }[state(point)] ?? "gap"), ` ${words(state(point))}`, point.left_out ? h("span", { class: "muted small" }, ` ${point.left_out}`) : null) },
    ...(mayChange ? [{ head: "Change", cell: (point) => (point.left_out ? small("Use again", (event) => act(event.target, () => changePoint(point.name, { left_out: null })), { "aria-label": `Use ${point.name} again` }) : small("Leave out…", () => leaveOut(point.name), { "aria-label": `Leave out ${point.name}` })) }] : []),
  ];
  return table(columns, road.points, { caption: "Control points against the map without them", stack: true });
}

function drawGrid(result) {
  return [...new Set(result.points.map(({ part }) => part))].map((part) => {
    const mine = result.points.filter((each) => each.part === part);
    const [xs, ys] = ["x_m", "y_m"].map((axis) => axisOf(mine, axis));
    const at = new Map(mine.map((each) => [`${each.x_m} ${each.y_m}`, each]));
    const cell = (x, y) => {
      const each = at.get(`${x} ${y}`);
      if (!each) return "";
      const lux = fixed(each.illuminance_lx, 1);
      return each.name === result.minimum ? h("strong", { class: "lowest" }, lux) : lux;
    };
    const columns = [{ head: `${part}: y \\ x`, header: true, cell: (y) => fixed(y, 2) }, ...xs.map((x) => ({ head: fixed(x, 2), class: "number", cell: (y) => cell(x, y) }))];
    return h("div", { class: "grid-scroll", tabindex: "0", role: "region", "aria-label": `Grid of ${part}` }, table(columns, ys, { caption: `Illuminance on ${part} in lx; framed: the minimum` }));
  });
}
