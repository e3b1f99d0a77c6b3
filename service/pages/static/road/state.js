// What a person states of a road: its site, the frames with marks set on their pictures, and control points.

import { all, get, patch, post, send } from "../api.js";
import { ask } from "../ask.js";
import { field } from "../campaign/forms.js";
import { fill, h, openDialog } from "../dom.js";
import { words } from "../format.js";
import { methodOf } from "../methods.js";
import { act } from "../states.js";

const FEWEST_MARKS = 4;
const SIZES = [
  ["spacing_m", "Spacing of the luminaires [m]", "Along the road, between two of one row: the length of the field.", 30],
  ["height_m", "Height of the lamps [m]", "Above the road.", 8],
  ["y_m", "Row of luminaires from the kerb [m]", "Negative beside the road: the arm ends there.", -0.5],
  ["lanes", "Lanes", "Side by side from the kerb on.", 2],
  ["width_m", "Width of a lane [m]", "Of each of them.", 3.5],
];

const LAMPS = ["incandescent", "led", "led_ripple", "led_phase_dimmed", "sodium", "metal_halide"];
const CONDITIONS = [
  { name: "surface", label: "Surface", options: [["dry", "Dry"], ["moist", "Moist"], ["wet", "Wet"], ["", "Not recorded"]], help: "A wet road mirrors its lamps: it is not evaluated." },
  { name: "lamp_kind", label: "Lamps", options: [["", "Not recorded"], ...LAMPS.map((kind) => [kind, words(kind)])], help: "Their flicker and spectrum enter the uncertainty." },
  { name: "mains_frequency_hz", label: "Mains", options: [["", "Not recorded"], ["50", "50 Hz"], ["60", "60 Hz"]], help: "Exposure times without flicker follow from it." },
  { name: "power_w", label: "Power of one spacing [W]", type: "number", step: "any", help: "Of all its luminaires with their gear: for the power density." },
  { name: "remarks", label: "Remarks", help: "Age of the lamps, climate, other light: the report states them." },
];

export async function createRoad() {
  const { items: rules } = await get("/v1/road-rules");
  const classes = rules.flatMap(({ name, classes: each }) => each.map((one) => [`${name}|${one.name}`, `${one.name}, ${name}`]));
  const made = await ask({
    title: "New road",
    fields: [
      { name: "name", label: "Name", help: "Street and night, as the report names them." },
      { name: "class", label: "Class", options: classes, value: "EN 13201-2:2015|C3", help: "Of a rule; compare its figures with your copy of the standard." },
      ...SIZES.map(([name, label, help, value]) => ({ name, label, help, value, type: "number", step: "any" })),
      ...CONDITIONS.map((each) => ({ ...each, required: false })),
    ],
    submit: "Register",
    action: (typed) => {
      const [rule, road_class] = typed.class.split("|");
      const size = (name) => Number(typed[name]);
      const strips = Array.from({ length: size("lanes") }, (_, at) => ({ name: String(at + 1), kind: "lane", y_m: at * size("width_m"), width_m: size("width_m") }));
      const rows = [{ y_m: size("y_m"), height_m: size("height_m"), spacing_m: size("spacing_m") }];
      const stated = CONDITIONS.filter(({ name }) => typed[name]).map(({ name }) => [name, /_(hz|w)$/.test(name) ? size(name) : typed[name]]);
      return post("/v1/roads", { name: typed.name, requirement: { rule, road_class }, site: { rows, strips }, conditions: Object.fromEntries(stated) });
    },
  });
  if (made) location.href = `/roads/${made.id}`;
}

export const typePoints = (path) =>
  ask({
    title: "Control points",
    fields: [{ name: "table", label: "Table", type: "textarea", rows: 9, hint: "name,x_m,y_m,quantity,unit,value,value_2", help: "A line a point under the names of its columns, as a spreadsheet copies it; it takes the place of all points that are there.", value: "name,x_m,y_m,quantity,unit,value,value_2\n" }],
    submit: "Save",
    action: async ({ table }) => (await send("PUT", `${path}/points`, { body: table, headers: { "Content-Type": "text/csv" } })).json(),
  });

/** Choose a frame, and set marks on its picture: a touch, then where on the road that is. */
export async function addFrame(road) {
  const campaigns = (await all("/v1/campaigns")).filter(({ method }) => methodOf(method).measurement_options.includes("grid"));
  const frames = (await Promise.all(campaigns.map(({ id }) => all(`/v1/campaigns/${id}/frames`)))).flat().filter((each) => each.role === "field" && each.width_px);
  const marks = [];
  const chosen = h("select", {}, frames.map((each) => h("option", { value: each.id }, each.filename)));
  const picture = h("img", { class: "mark-picture", alt: "The frame; touch a point of the road that you know" });
  const list = h("ol", { class: "small" });
  const x = h("input", { type: "number", step: "any" });
  const y = h("input", { type: "number", step: "any" });
  const save = h("button", { type: "button", class: "primary", onclick: (event) => act(event.target, keep) }, "Save");
  const told = h("p", { role: "status", class: "small" });
  const show = () => (picture.src = `/v1/frames/${chosen.value}/preview.png`);
  const dialog = h("dialog", { "aria-label": "Frame of the road" }, h("h2", {}, "Frame of the road"), field("Frame", chosen, null, "A field frame of a luminance campaign or of a measuring night."), h("div", { class: "pair-fields" }, field("Along [m]", x, null, "Place of the next mark along the road, from the first luminaire."), field("Across [m]", y, null, "Place of the next mark across, from the kerb.")), h("p", { class: "small" }, "Type where a point lies on the road, then touch it in the picture: four or more that surround the field."), picture, list, told, h("div", { class: "actions" }, h("button", { type: "button", onclick: () => dialog.close() }, "Cancel"), save));
  chosen.addEventListener("change", () => {
    marks.length = 0;
    draw();
    show();
  });
  picture.addEventListener("click", (event) => {
    if (x.value === "" || y.value === "") return (told.textContent = "Type the place on the road first.");
    const { width_px: width, height_px: height } = frames.find(({ id }) => id === chosen.value);
    const box = picture.getBoundingClientRect();
    marks.push({ x_px: ((event.clientX - box.left) / box.width) * width, y_px: ((event.clientY - box.top) / box.height) * height, x_m: Number(x.value), y_m: Number(y.value) });
    x.value = y.value = told.textContent = "";
    return draw();
  });
  show();
  draw();
  openDialog(dialog);
  return new Promise((done) => dialog.addEventListener("close", () => done(dialog.returnValue === "saved")));

  function draw() {
    save.disabled = marks.length < FEWEST_MARKS;
    fill(list, marks.map((each, at) => h("li", {}, `${each.x_m}, ${each.y_m} m at ${Math.round(each.x_px)}, ${Math.round(each.y_px)} px `, h("button", { type: "button", class: "link-button", "aria-label": `Remove mark ${at + 1}`, onclick: () => (marks.splice(at, 1), draw()) }, "Remove"))));
  }

  async function keep() {
    const kept = road.frames.filter((each) => each.frame_id !== chosen.value);
    await patch(`/v1/roads/${road.id}`, { frames: [...kept, { frame_id: chosen.value, marks }] });
    dialog.close("saved");
  }
}
