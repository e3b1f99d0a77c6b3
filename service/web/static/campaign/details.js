// What is written on a campaign: corrected, its camera exchanged, put away.

import { all, patch } from "../api.js";
import { ask } from "../ask.js";
import { h, may } from "../dom.js";
import { cameraName } from "../format.js";
import { inOrder } from "../groups.js";
import { done } from "../undo.js";

/** What a person writes on a campaign. */
export const DETAILS = [
  { name: "project_number", label: "Project number" },
  { name: "customer", label: "Customer" },
  { name: "place", label: "Place" },
  { name: "recorder", label: "Recorded by" },
  { name: "started_at", label: "Start (UTC)", type: "datetime-local" },
  { name: "conditions", label: "Conditions", type: "textarea" },
  { name: "comments", label: "Comments", type: "textarea" },
];

const typed = (campaign, name) => (name === "started_at" ? campaign.started_at?.slice(0, 16) : campaign[name]) ?? "";
/** As the API takes it. */
export const sent = (name, value) => (name === "started_at" ? new Date(`${value}Z`).toISOString() : value);

/** Correct a campaign; fields that are emptied are taken away. `only` names the fields that are asked for. */
export async function editDetails(campaign, { only, cameras } = {}) {
  const fields = DETAILS.filter((each) => !only || only.includes(each.name)).map((each) => ({ ...each, of: "NewCampaign", required: false, value: typed(campaign, each.name) }));
  const known = cameras ?? (only ? [] : await all("/v1/cameras"));
  const camera = known.length ? [{ name: "camera_id", label: "Camera", of: "NewCampaign", options: inOrder(known, cameraName).map((each) => [each.id, cameraName(each)]), value: campaign.camera_id, hint: "Frames are checked against another camera; nothing is sent again." }] : [];
  return ask({
    title: only ? "Add what the certificate lacks" : "Edit details",
    fields: [...camera, ...fields],
    submit: "Save",
    action: async (values) => {
      const wanted = Object.fromEntries([...camera, ...fields].map(({ name }) => [name, values[name] ?? ""]));
      const changed = Object.keys(wanted).filter((name) => wanted[name] !== (name === "camera_id" ? campaign.camera_id : typed(campaign, name)));
      // a start can be corrected, not taken away
      const said = Object.fromEntries(changed.filter((name) => name !== "started_at" || wanted[name]).map((name) => [name, sent(name, wanted[name])]));
      return Object.keys(said).length ? patch(`/v1/campaigns/${campaign.id}`, said) : campaign;
    },
  });
}

/** The buttons in the head of a campaign's page. */
export function detailsPart(state) {
  if (!may("calibrate")) return null;
  const edit = async () => (await editDetails(state.campaign)) && location.reload();
  const archive = async () => {
    const archived = !state.campaign.archived_at;
    state.campaign = await patch(state.path, { archived });
    draw();
    done(archived ? "Archived." : "Taken out of the archive.", async () => {
      state.campaign = await patch(state.path, { archived: !archived });
      draw();
    });
  };
  const button = h("button", { type: "button", class: "quiet", onclick: archive });
  const draw = () => (button.textContent = state.campaign.archived_at ? "Take out of the archive" : "Archive");
  draw();
  return [h("button", { type: "button", onclick: edit }, "Edit details"), button];
}
