// Comparison of two measurements: the difference and its significance, both maps, every cell.

import { get } from "../api.js";
import { byId, empty, figure, fill, h, load } from "../dom.js";
import { day, quantity, typeset, withUncertainty } from "../format.js";
import { MapView, cellTable, loadMap, scaleTools } from "./map.js";
import { regionOf } from "./words.js";

const { old, new: newer } = document.querySelector("main").dataset;
const given = new URL(location.href).searchParams;
const asked = ["other_region", "same_light"].map((name) => (given.get(name) === "true" ? `&${name}=true` : "")).join("");
const both = Promise.all([get(`/v1/measurements/${old}`), get(`/v1/measurements/${newer}`)]);
const views = {};

load(byId("verdict"), compared, (found) => {
  if (found.code) return refused(found);
  byId("cells-section").hidden = !found.cells;
  if (found.cells) fill(byId("cells"), cellTable(found.cells, changeOf, { caption: "Change of each cell in %" }));
  return [
    h("p", { class: `note ${found.significant ? "warn" : ""}` }, h("strong", {}, typeset(found.said))),
    found.confusion_rel === undefined ? null : h("p", { class: "note" }, `Two types of lamp could show a change of up to ${Math.round(100 * found.confusion_rel)} % without any. `, h("a", { href: `${location.pathname}?${new URLSearchParams([...new URL(location.href).searchParams, ["same_light", "true"]])}` }, "The same lamps lit both")),
    h("dl", { class: "figures" },
      side("Older", found.old),
      side("Newer", found.new),
      figure("Difference", quantity(found.difference), found.change ? changeText(found.change) : ""),
      figure("Difference / u", found.in_standard_uncertainties === undefined ? "–" : found.in_standard_uncertainties.toFixed(1), found.significant ? "2 or more: significant" : "below 2: not significant"),
    ),
    h("p", { class: "small muted" }, found.common.length ? `Errors common to both cancel: ${found.common.join(", ")}.` : "No common errors: both uncertainties count in full."),
  ];
});

for (const [place, index] of [["old", 0], ["new", 1]]) {
  load(byId(`map-${place}`), async () => mapOf((await both)[index], place), (drawn) => drawn);
}

async function compared() {
  try {
    return await get(`/v1/measurements/${newer}/comparison?old=${old}${asked}`);
  } catch (error) {
    if (error.code !== "regions_differ") throw error;
    return error;
  }
}

const refused = ({ message }) => [
  h("p", { class: "note warn" }, h("strong", {}, "The two outlines differ."), ` ${message}`),
  h("p", { class: "actions" }, h("a", { class: "button", href: `/measurements/comparison?old=${old}&new=${newer}&other_region=true` }, "Compare nevertheless")),
];

async function mapOf(found, place) {
  const title = h("h3", {}, h("a", { href: `/measurements/${found.id}` }, found.filename), h("span", { class: "muted" }, ` ${found.taken_at ? day(found.taken_at) : ""}`));
  if (!found.links.map_tif) return [title, empty("No map", "Measure the frame again with a map to see it here.")];
  const map = await loadMap(found, await get(found.links.frame));
  views[place] = new MapView(map, { region: found.region, grid: found.grid, name: `Map of ${found.filename}` });
  fill(byId("map-tools"), scaleTools(Object.values(views)));
  return [title, views[place].element];
}

const side = (name, found) => figure(name, quantity(found.mean), `${found.taken_at ? `${day(found.taken_at)}, ` : ""}${found.filename}; of ${regionOf(found)}`);
const changeText = (change) => `${change.value > 0 ? "+" : ""}${withUncertainty(change.value, change.standard_uncertainty)} %`;

function changeOf(cell) {
  if (!cell.change) return "–";
  const sure = cell.in_standard_uncertainties >= 2;
  return h("span", { class: sure ? "significant" : "muted", title: `${cell.in_standard_uncertainties?.toFixed(1)} standard uncertainties` }, changeText(cell.change).replace(" %", ""), sure ? h("span", { class: "hidden" }, " significant") : null);
}
