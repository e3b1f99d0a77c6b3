// The roads of the organisation, newest first, each with its last verdict.

import { all } from "../api.js";
import { byId, h, mark, table } from "../dom.js";
import { time, words } from "../format.js";
import { act, empty, load } from "../states.js";
import { createRoad } from "./state.js";

export const MARKS = { conforms: "good", does_not: "bad", not_decided: "open", not_measured: "gap" };

export const said = (verdict) => h("span", { class: "nowrap" }, mark(MARKS[verdict]), ` ${words(verdict)}`);

byId("new")?.addEventListener("click", (event) => act(event.target, createRoad));

const place = byId("roads");
if (place) {
  load(place, () => all("/v1/roads"), (roads) => {
    if (!roads.length) return empty("No roads yet", "State its site here, with stilb road, or over the API.", h("a", { class: "button", href: "/docs/command-line" }, "Manual"));
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
