// The roads of the organisation with their last verdicts, and what a person states of one.

import { all, get, post, send } from "../api.js";
import { ask } from "../ask.js";
import { act, byId, empty, h, load, mark, table } from "../dom.js";
import { capital, inOrder, stateWords, time, words } from "../format.js";
import { LANES } from "../measurement/surface.js";
import { methodOf } from "../methods.js";

export const MARKS = { conforms: "good", does_not: "bad", not_decided: "open", not_measured: "gap" };

export const said = (verdict) => h("span", { class: "nowrap" }, mark(MARKS[verdict]), ` ${words(verdict)}`);

const create = byId("new");
const from = new URLSearchParams(location.search).get("from");
create?.addEventListener("click", () => act(create, createRoad));
if (create && from) act(create, async () => createRoad(await get(`/v1/measurements/${from}`)));

const place = byId("roads");
if (place) {
  load(place, () => all("/v1/roads"), (roads) => {
    if (!roads.length) return empty("No roads yet", "State the site of a road here, with stilb road, or over the API.", h("a", { class: "button", href: "/docs/command-line" }, "Manual"));
    const columns = [
      { head: "Road", header: true, cell: (road) => h("a", { href: `/roads/${road.id}` }, road.name) },
      { head: "Class", cell: (road) => road.requirement.road_class },
      { head: "Verdict", cell: (road) => (road.results.length ? said(road.results.at(-1).verdict) : "not evaluated") },
      { head: "Frames", class: "number", cell: (road) => road.frames.length },
      { head: "Points", class: "number", cell: (road) => road.points.length },
      { head: "Registered", cell: (road) => time(road.created_at) },
    ];
    return table(columns, roads, { caption: "Roads", stack: true });
  });
}

export const FEWEST_MARKS = 4;
const SIZES = [
  ["height_m", "Height of the lamps [m]", 8, "Above the road."],
  ["y_m", "Row of luminaires from the kerb [m]", -0.5, "Negative beside the road: the arm ends there."],
];

const CONDITIONS = [
  { name: "surface", label: "Surface", options: [["dry", "Dry"], ["moist", "Moist"], ["wet", "Wet"], ["", "Not recorded"]], help: "A wet road mirrors its lamps: it is not evaluated." },
  { name: "lamp_kind", label: "Lamps", options: [["", "Not recorded"], ...["incandescent", "led", "led_ripple", "led_phase_dimmed", "sodium", "metal_halide"].map((kind) => [kind, capital(stateWords(kind))])], help: "Their flicker and spectrum enter the uncertainty." },
  { name: "mains_frequency_hz", label: "Mains", options: [["", "Not recorded"], ["50", "50 Hz"], ["60", "60 Hz"]], help: "Exposure times without flicker follow from it." },
  { name: "power_w", label: "Power of one spacing [W]", type: "number", step: "any", help: "Of all its luminaires with their gear: for the power density." },
  { name: "remarks", label: "Remarks", help: "Age of the lamps, climate, other light: the report states them." },
];

/** `taken`: a measurement whose lanes and their four corners in the frame are taken over. */
async function createRoad(taken) {
  const { items: rules } = await get("/v1/road-rules");
  const classes = rules.flatMap(({ name, classes: each }) => each.map((one) => [`${name}|${one.name}`, `${one.name}, ${name}`]));
  const marked = taken?.grid.lanes;
  const size = { type: "number", step: "any" };
  const made = await ask({
    title: "New road",
    fields: [
      { name: "name", label: "Name", help: "Street and night, as the report names them." },
      { name: "class", label: "Class", options: classes, value: "EN 13201-2:2015|C3", help: "Of a rule; compare its figures with your copy of the standard." },
      ...LANES.map(([name, label, value]) => ({ name, label, value: marked?.[name] ?? value, of: "NewGrid", ...size })),
      ...SIZES.map(([name, label, value, help]) => ({ name, label, value, help, ...size })),
      ...CONDITIONS.map((each) => ({ ...each, required: false })),
    ],
    submit: "Register",
    action: (typed) => {
      const [rule, road_class] = typed.class.split("|");
      const [lanes, width_m, spacing_m, height_m, y_m] = [...LANES, ...SIZES].map(([name]) => Number(typed[name]));
      const strips = Array.from({ length: lanes }, (_, at) => ({ name: String(at + 1), kind: "lane", y_m: at * width_m, width_m }));
      const stated = CONDITIONS.filter(({ name }) => typed[name]).map(({ name }) => [name, /_(hz|w)$/.test(name) ? Number(typed[name]) : typed[name]]);
      const frames = marked ? [{ frame_id: taken.frame_id, marks: cornersOf([0, marked.length_m], [0, marked.lanes * marked.lane_width_m], marked.marked) }] : undefined;
      return post("/v1/roads", { name: typed.name, requirement: { rule, road_class }, site: { rows: [{ y_m, height_m, spacing_m }], strips }, conditions: Object.fromEntries(stated), frames });
    },
  });
  if (made) location.href = `/roads/${made.id}`;
}

/** The corners of a rectangle on the road as marks, in the order in which they are drawn. */
export const cornersOf = ([x0, x1], [y0, y1], pixels) => [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(([x_m, y_m], at) => ({ x_px: pixels[at][0], y_px: pixels[at][1], x_m, y_m }));

export const typePoints = (path) => ask({
  title: "Control points",
  fields: [{ name: "table", label: "Table", type: "textarea", rows: 9, hint: "P1,0,1.75,25.3,25.1: value and value_2 in lx, or with the columns quantity and unit", help: "A line a point under the names of its columns, as a spreadsheet copies it; it takes the place of all points that are there.", value: "name,x_m,y_m,value,value_2\n" }],
  submit: "Save",
  action: async ({ table }) => (await send("PUT", `${path}/points`, { body: table, headers: { "Content-Type": "text/csv" } })).json(),
});

export async function addFrame() {
  const campaigns = (await all("/v1/campaigns")).filter(({ method }) => methodOf(method).measurement_options.includes("grid"));
  const frames = (await Promise.all(campaigns.map(({ id }) => all(`/v1/campaigns/${id}/frames`)))).flat().filter((each) => each.role === "field" && each.width_px);
  return ask({
    title: "Frame of the road",
    fields: [{ name: "id", label: "Frame", options: inOrder(frames, (each) => each.filename).map((each) => [each.id, each.filename]), help: "A field frame of a luminance campaign or of a measuring night." }],
    submit: "Add",
    action: ({ id }) => frames.find((each) => each.id === id),
  });
}
