// The reflectance panel of a campaign: a registered one, or one that is registered on the spot.

import { all, patch, post } from "../api.js";
import { ask } from "../ask.js";
import { h } from "../dom.js";
import { wrong } from "../states.js";
import { about, decimal, field, readNumber, select } from "./forms.js";

const NEW = "new";

/** A campaign that began without its panel, as one from a card does, is told it in a dialog. */
export async function choosePanel(state) {
  const panels = await all("/v1/panels");
  const { element, read } = panelPart(panels, panels.length ? (state.campaign.panel_id ?? "") : NEW);
  const action = async () => patch(state.path, { panel_id: await read() });
  if (await ask({ title: "Panel of this campaign", body: element, submit: "Save", action })) await state.touch();
}

/** {element, read()}: the form, and the id of the panel; undefined leaves the choice to the files. */
export function panelPart(panels, standing = "") {
  const known = panels.map((each) => [each.id, `${each.serial}, ${each.bands.some((band) => band.origin) ? "stated by files of" : "measured"} ${each.measured_on} (${each.bands.map((band) => band.band).join(", ")})`]);
  const chosen = select([["", "As named in the files, or the only one"], ...known, [NEW, "Register another…"]], {}, standing);
  const serial = decimal({ inputmode: "text" });
  const measured = h("input", { type: "date" });
  const bands = h("textarea", { rows: "5", spellcheck: "false" });
  const fresh = h(
    "fieldset",
    {},
    h("legend", {}, "New panel"),
    h("div", { class: "fields" }, field("Serial number", serial, null, about("NewPanel", "serial")), field("Measured on", measured, null, about("NewPanel", "measured_on"))),
    field("Reflectance", bands, "One line per band: green 0.69 0.005 (band, reflectance, and its standard uncertainty if known).", about("NewPanel", "bands")),
  );
  const show = () => {
    fresh.hidden = chosen.value !== NEW;
    serial.required = measured.required = bands.required = !fresh.hidden;
  };
  chosen.addEventListener("change", show);
  show();
  const read = async () => {
    if (chosen.value !== NEW) return chosen.value || undefined;
    const body = { serial: serial.value.trim(), measured_on: measured.value, bands: readBands(bands.value) };
    return (await post("/v1/panels", body)).id;
  };
  return { element: h("div", {}, field("Panel", chosen, null, about("NewCampaign", "panel_id")), fresh), read };
}

function readBands(text) {
  const lines = text.split("\n").map((line, index) => [index + 1, line.trim()]);
  return lines.filter(([, line]) => line).map(([number, line]) => {
    // a band's name may have two words, such as "Red edge": the numbers come last
    const said = line.split(/[\s;]+/);
    const figures = said.slice(-2).map(readNumber).filter((value) => !Number.isNaN(value));
    const band = said.slice(0, said.length - figures.length).join(" ");
    const [reflectance, uncertainty] = figures;
    if (!band || Number.isNaN(readNumber(said.at(-1)))) throw wrong(`Line ${number}: “${line}” should read as green 0.69 0.005.`);
    return { band, reflectance, ...(uncertainty === undefined ? {} : { standard_uncertainty: uncertainty }) };
  });
}
