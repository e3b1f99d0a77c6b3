// Lines of equal value over a map, at levels that are typed or chosen.

import { field } from "../campaign/forms.js";
import { get } from "../api.js";
import { byId, fill, h, svg } from "../dom.js";
import { number, unit, withUncertainty } from "../format.js";
import { failed } from "../states.js";

/** The tool of one map: the button beside it, and the section `isolines-section` below it. */
export function isolineTool(view, id) {
  const layer = svg("g", { class: "map-isolines" });
  view.over.insertBefore(layer, view.cross);
  const typed = h("input", { autocomplete: "off", spellcheck: "false", placeholder: "round ones", onchange: show });
  const told = h("div", { "aria-live": "polite" });
  const file = h("a", { class: "button", download: "" }, "GeoJSON");
  const button = h("button", { type: "button", "aria-pressed": "false", onclick: () => turn(button.getAttribute("aria-pressed") !== "true") }, "Isolines");
  fill(byId("isolines-tools"), file);
  fill(byId("isolines"), field("Levels", typed, "Values separated by commas, such as 0.5, 1, 2. Empty: round ones.", "/docs/measuring#isolines"), told);
  return button;

  function turn(on) {
    button.setAttribute("aria-pressed", String(on));
    byId("isolines-section").hidden = !on;
    if (on) show();
    else layer.replaceChildren();
  }

  async function show() {
    const levels = typed.value.trim().split(/[\s,;]+/).filter(Boolean).join(",");
    const query = levels ? new URLSearchParams({ levels }).toString() : "";
    file.href = `/v1/measurements/${id}/isolines.geojson?${query}`;
    try {
      const found = await get(`/v1/measurements/${id}/isolines.geojson?coordinates=pixel&${query}`);
      if (button.getAttribute("aria-pressed") === "true") draw(found);
    } catch (error) {
      layer.replaceChildren();
      fill(told, failed(error, show));
    }
  }

  function draw(found) {
    const size = view.map.width / 60;
    const paths = found.features.flatMap(({ geometry, properties }) => {
      const d = geometry.coordinates.map((line) => `M${line.join("L")}`).join("");
      if (!d) return [];
      const longest = geometry.coordinates.reduce((best, line) => (line.length > best.length ? line : best));
      const [x, y] = longest[Math.floor(longest.length / 2)];
      const label = svg("text", { x, y, "font-size": size, "stroke-width": size / 5 });
      label.append(number(properties.level, 3));
      return [svg("path", { class: "back", d }), svg("path", { d }), label];
    });
    layer.replaceChildren(...paths);
    fill(told, describe(found));
  }
}

function describe(found) {
  const drawn = found.features.filter(({ properties }) => properties.lines);
  const rings = found.features.reduce((sum, { properties }) => sum + properties.rings_left_out, 0);
  const scale = found.step_px > 1 ? `Of means over squares of ${found.step_px} px` : "Of single pixels";
  return [
    drawn.length ? h("ul", { class: "map-levels" }, drawn.map(level)) : h("p", { class: "muted" }, "No line at these levels."),
    h("ul", { class: "small muted map-notes" }, [
      `${scale}: finer detail is not drawn, nor what the lens does not resolve.`,
      rings ? `${rings} ring${rings === 1 ? "" : "s"} around a single square left out: noise, or a lamp.` : null,
      found.unknown_share ? `${number(100 * found.unknown_share, 2)} % of the squares are saturated: no line crosses them.` : null,
      ...found.notes,
    ].filter(Boolean).map((note) => h("li", {}, note))),
  ];
}

function level({ properties }) {
  const { level: value, unit: name, standard_uncertainty: u, place_u_px: place, too_dark: dark } = properties;
  const figure = `${u === undefined ? number(value, 3) : withUncertainty(value, u)} ${name === "1" ? "" : unit(name)}`.trim();
  const notes = [place === undefined ? null : `place ± ${number(place, 2)} px`, dark ? "not distinguished from zero" : null].filter(Boolean);
  return h("li", {}, figure, notes.length ? h("span", { class: "muted" }, ` (${notes.join("; ")})`) : null);
}
