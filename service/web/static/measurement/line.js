// A profile along a line that is drawn on a map, typed, or set with the keys.

import { field } from "../campaign/forms.js";
import { byId, figure, fill, h, svg } from "../dom.js";
import { get } from "../api.js";
import { number, quantity, words } from "../format.js";
import { plot } from "../plots.js";
import { failed } from "../states.js";

const SHORTEST_PX = 2;
const DRAWN = 1000;

/** The tool of one map: the button beside the map, and the section `line-section` below it. */
export function lineTool(view, id) {
  const { map, over } = view;
  const [back, line, spot] = [svg("polyline", { class: "map-line back" }), svg("polyline", { class: "map-line" }), svg("circle", { class: "map-spot", r: Math.max(map.width, map.height) / 150, visibility: "hidden" })];
  over.append(back, line, spot);
  const typed = h("input", { autocomplete: "off", spellcheck: "false", placeholder: "x,y x,y", onchange: () => take(typed.value) });
  const across = h("input", { type: "number", min: 1, max: 101, value: 1, onchange: () => points && show() });
  const [place, told] = [h("div", { class: "plot", role: "group", "aria-label": "Profile along the line", tabindex: "0" }), h("div", {})];
  const csv = h("a", { class: "button", download: "" }, "CSV");
  const button = h("button", { type: "button", "aria-pressed": "false", onclick: () => turn(button.getAttribute("aria-pressed") !== "true") }, "Draw a line");
  let [points, start, logarithmic] = [null, null, false];
  const axes = [["Linear", false], ["Logarithmic", true]].map(([text, value]) =>
    h("button", { type: "button", "aria-pressed": String(value === logarithmic), onclick: (event) => {
      logarithmic = value;
      for (const each of axes) each.setAttribute("aria-pressed", String(each === event.target));
      show();
    } }, text),
  );
  fill(byId("line-tools"), h("div", { class: "segments", role: "group", "aria-label": "Axis of the profile" }, axes), csv);
  fill(byId("line"), h("div", { class: "fields" }, field("Corners", typed, "x,y pairs in pixels, separated by blanks. More than two follow a curve.", "/docs/measuring#profiles-isolines-and-histograms"), field("Pixels across", across, "Averaged, against noise.", "/docs/measuring#profiles-isolines-and-histograms")), told, place);
  listen();
  return button;

  function turn(on) {
    button.setAttribute("aria-pressed", String(on));
    over.classList.toggle("drawing-line", on);
    byId("line-section").hidden = !on && !points;
    start = null;
    if (on) fill(view.said, "Draw on the map, or set start and end with Enter.");
  }

  function listen() {
    const drawing = () => button.getAttribute("aria-pressed") === "true";
    const middle = (event) => view.under(event).map((at) => at + 0.5).reverse();
    over.addEventListener("pointerdown", (event) => {
      if (!drawing() || event.button !== 0) return;
      over.setPointerCapture(event.pointerId);
      start = middle(event);
    });
    over.addEventListener("pointermove", (event) => start && event.buttons && draw([start, middle(event)]));
    over.addEventListener("pointercancel", () => (start = null));
    over.addEventListener("pointerup", (event) => {
      if (!start || !drawing()) return;
      const end = middle(event);
      if (Math.hypot(end[0] - start[0], end[1] - start[1]) >= SHORTEST_PX) settle([start, end]);
      start = null;
    });
    over.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && start) start = null;
      if (event.key !== "Enter" || !drawing()) return;
      event.preventDefault();
      const here = [view.place[1] + 0.5, view.place[0] + 0.5];
      if (!start) {
        start = here;
        draw([start]);
        fill(view.said, `Start at x ${here[0]}, y ${here[1]}. Move the cross and press Enter at the end.`);
      } else {
        settle([start, here]);
        start = null;
      }
    });
  }

  function draw(corners) {
    for (const each of [back, line]) each.setAttribute("points", corners.join(" "));
  }

  function take(text) {
    const corners = text.trim().split(/\s+/).map((pair) => pair.split(",").map(Number));
    if (corners.length >= 2 && corners.every((corner) => corner.length === 2 && corner.every(Number.isFinite))) settle(corners);
    else fill(told, h("p", { class: "note warn" }, "Two corners or more: x,y x,y"));
  }

  function settle(corners) {
    points = corners;
    draw(points);
    typed.value = points.map((point) => point.join(",")).join(" ");
    byId("line-section").hidden = false;
    show();
  }

  async function show() {
    if (!points) return;
    const query = new URLSearchParams({ line: points.map((point) => point.join(",")).join(" "), across_px: across.value });
    csv.href = `/v1/measurements/${id}/profile.csv?${query}&most=10000`;
    const asked = points;
    try {
      const profile = await get(`/v1/measurements/${id}/profile.json?${query}&most=${DRAWN}`);
      if (asked !== points) return;
      fill(told, describe(profile));
      plot(place, `/plots/measurements/${id}/profile?${query}&axis=${logarithmic ? "logarithmic" : "linear"}`, (chart) => tie(chart, profile));
    } catch (error) {
      fill(place);
      fill(told, failed(error, show));
    }
  }

  /** The place on the map of what is pointed at in the chart. */
  function tie(chart, profile) {
    const { low, high } = chart.dataset;
    const along = (point) => (profile.scale ? point.distance_m : point.distance_px);
    chart.addEventListener("pointermove", ({ clientX }) => {
      const box = chart.querySelector(".box").getBoundingClientRect();
      const at = Number(low) + ((clientX - box.left) / box.width) * (high - low);
      const nearest = profile.points.reduce((best, point) => (Math.abs(along(point) - at) < Math.abs(along(best) - at) ? point : best));
      spot.setAttribute("cx", nearest.x_px);
      spot.setAttribute("cy", nearest.y_px);
      spot.setAttribute("visibility", "visible");
      view.look([Math.floor(nearest.y_px), Math.floor(nearest.x_px)].map((pixel, axis) => Math.min(pixel, [map.height, map.width][axis] - 1)));
    });
    chart.addEventListener("pointerleave", () => spot.setAttribute("visibility", "hidden"));
  }
}

function describe(profile) {
  const gaps = Object.entries(profile.gaps).filter(([, count]) => count);
  const length = profile.length_m === undefined ? `${number(profile.length_px, 4)} px` : `${number(profile.length_m, 4)} m`;
  const of = profile.length_m === undefined ? "" : `${number(profile.length_px, 4)} px; ${profile.scale === "road_m" ? "on the road" : "on the ground"}`;
  return [
    h(
      "dl",
      { class: "figures" },
      figure("Length", length, of),
      profile.mean ? [figure("Mean", quantity(profile.mean)), figure("Smallest", quantity(profile.min)), figure("Largest", quantity(profile.max))] : null,
      profile.min_to_max === undefined ? null : figure("Smallest / largest", number(profile.min_to_max, 2), "of single points, seen from above"),
      gaps.length ? figure("Gaps", gaps.map(([kind, count]) => `${count} ${words(kind)}`).join(", "), `of ${profile.points.length} points`) : null,
    ),
    h("ul", { class: "small muted map-notes" }, profile.notes.map((note) => h("li", {}, note))),
  ];
}

