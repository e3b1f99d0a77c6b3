// What is written on a campaign: corrected, its camera exchanged, put away.

import { all, patch } from "../api.js";
import { ask } from "../ask.js";
import { act, done, h, leave, may } from "../dom.js";
import { cameraName, inOrder } from "../format.js";

export const DETAILS = [
  { name: "project_number", label: "Project number" },
  { name: "customer", label: "Customer" },
  { name: "place", label: "Place" },
  { name: "recorder", label: "Recorded by" },
  { name: "started_at", label: "Start (UTC)", type: "datetime-local" },
  { name: "ended_at", label: "End (UTC)", type: "datetime-local" },
  { name: "time_zone", label: "Time zone" },
  { name: "lens_make", label: "Lens make", of: ["Lens", "make"] },
  { name: "lens_model", label: "Lens model", of: ["Lens", "model"] },
  { name: "lens_serial", label: "Lens serial number", of: ["Lens", "serial"] },
  { name: "conditions", label: "Conditions", type: "textarea" },
  { name: "comments", label: "Comments", type: "textarea" },
];

const OF_LENS = /^lens_/;
export const isOfLens = (name) => OF_LENS.test(name);
const isTime = (name) => name.endsWith("_at");
const typed = (campaign, name) => (isOfLens(name) ? campaign.lens?.[name.replace(OF_LENS, "")] : isTime(name) ? campaign[name]?.slice(0, 16) : campaign[name]) ?? "";

/** What was typed, by name, as the API takes it: a lens in one piece, times as instants. */
export function detailsOf(values) {
  const own = Object.entries(values).filter(([name]) => !isOfLens(name));
  const lens = Object.entries(values).filter(([name, text]) => isOfLens(name) && text).map(([name, text]) => [name.replace(OF_LENS, ""), text]);
  const ofLens = Object.keys(values).some(isOfLens) ? { lens: lens.length ? Object.fromEntries(lens) : "" } : {};
  return { ...Object.fromEntries(own.map(([name, text]) => [name, isTime(name) && text ? new Date(`${text}Z`).toISOString() : text])), ...ofLens };
}

/** Correct a campaign; fields that are emptied are taken away. `only` names the fields that are asked for. */
export async function editDetails(campaign, { only, cameras } = {}) {
  const fields = DETAILS.filter((each) => !only || only.includes(each.name)).map((each) => ({ of: "NewCampaign", ...each, required: false, value: typed(campaign, each.name) }));
  const known = cameras ?? (only ? [] : await all("/v1/cameras"));
  const camera = known.length ? [{ name: "camera_id", label: "Camera", of: "NewCampaign", options: inOrder(known, cameraName).map((each) => [each.id, cameraName(each)]), value: campaign.camera_id, hint: "Frames are checked against another camera; nothing is sent again." }] : [];
  return ask({
    title: only ? "Add what the certificate lacks" : "Edit details",
    fields: [...camera, ...fields],
    submit: "Save",
    action: async (values) => {
      const wanted = Object.fromEntries([...camera, ...fields].map(({ name }) => [name, values[name] ?? ""]));
      const changed = Object.keys(wanted).filter((name) => wanted[name] !== (name === "camera_id" ? campaign.camera_id : typed(campaign, name)));
      const lens = changed.some(isOfLens);
      // a start can be corrected, not taken away
      const kept = Object.keys(wanted).filter((name) => (isOfLens(name) ? lens : changed.includes(name) && (name !== "started_at" || wanted[name])));
      const said = detailsOf(Object.fromEntries(kept.map((name) => [name, wanted[name]])));
      return Object.keys(said).length ? patch(`/v1/campaigns/${campaign.id}`, said) : campaign;
    },
  });
}

export const changeDetails = async (state) => (await editDetails(state.campaign)) && leave();

export function detailsPart(state) {
  if (!may("calibrate")) return null;
  const turn = async (archived) => {
    state.campaign = await patch(state.path, { archived });
    draw();
  };
  const archive = async () => {
    const archived = !state.campaign.archived_at;
    await turn(archived);
    done(archived ? "Archived." : "Taken out of the archive.", () => turn(!archived));
  };
  const button = h("button", { type: "button", class: "quiet", onclick: () => act(button, archive) });
  const draw = () => (button.textContent = state.campaign.archived_at ? "Take out of the archive" : "Archive");
  draw();
  return [h("button", { type: "button", onclick: (event) => act(event.target, () => changeDetails(state)) }, "Edit details"), button];
}
