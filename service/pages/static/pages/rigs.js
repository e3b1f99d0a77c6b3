// The rigs, and a new one from campaigns whose pictures were taken together.

import { all, get, post } from "../api.js";
import { about, field } from "../ask.js";
import { act, byId, empty, h, leave, load, may, table, wrong } from "../dom.js";
import { inOrder, time } from "../format.js";
import { startOf } from "../methods.js";

const { method } = document.querySelector("main").dataset;
const wanted = new URLSearchParams(location.search).get("campaign");

const cameras = all("/v1/cameras").then((found) => new Map(found.map((each) => [each.id, each])));

load(byId("rigs"), () => Promise.all([all("/v1/rigs"), cameras]), ([rigs, known]) => {
  if (!rigs.length) return empty("No rigs yet", "Photograph one board with all cameras at once, in a campaign of each camera; then register them here.");
  const columns = [
    { head: "Rig", header: true, cell: (rig) => h("a", { href: `/rigs/${rig.id}` }, rig.name) },
    { head: "Reference", cell: (rig) => serialOf(known.get(rig.camera_ids[0])) },
    { head: "Other cameras", cell: (rig) => h("span", {}, rig.camera_ids.slice(1).map((id, place) => [place ? ", " : "", serialOf(known.get(id))])) },
    { head: "Registered", cell: (rig) => time(rig.created_at) },
  ];
  return table(columns, inOrder(rigs, (rig) => rig.name), { caption: "Rigs and their cameras", stack: true });
});

if (may("calibrate")) {
  byId("new-section").hidden = false;
  load(byId("new-rig"), () => Promise.all([all("/v1/campaigns"), cameras]), ([campaigns, known]) => {
    const suited = campaigns.filter((each) => each.method === method).reverse();
    if (new Set(suited.map((each) => each.camera_id)).size < 2) {
      return empty("No campaigns to choose from", "Campaigns of two cameras are needed, with pictures of one board.", h("a", { class: "button", href: "/campaigns/new" }, "New campaign"));
    }
    return form(suited, known);
  });
}

const serialOf = (camera) => h("span", { class: "mono" }, camera.serial);

function form(campaigns, known) {
  const first = campaigns.find((each) => each.id === wanted) ?? campaigns[0];
  // of each camera the campaign of the same day
  const likely = new Map(campaigns.filter((each) => startOf(each) === startOf(first)).map((each) => [each.camera_id, each.id]));
  likely.set(first.camera_id, first.id);
  const chosen = new Set(likely.values());
  const camera = (each) => known.get(each.camera_id);
  const named = (each) => `${camera(each).model} ${camera(each).serial}, ${startOf(each)}`;
  const columns = [
    { head: "Together", cell: (each) => h("input", { type: "checkbox", name: "campaign", value: each.id, checked: chosen.has(each.id), "aria-label": `Taken together: ${named(each)}` }) },
    { head: "Reference", cell: (each) => h("input", { type: "radio", name: "reference", value: each.id, required: true, checked: each === first, "aria-label": `Reference: ${named(each)}` }) },
    { head: "Campaign", header: true, cell: (each) => h("a", { href: `/campaigns/${each.id}` }, `${camera(each).make} ${camera(each).model}`) },
    { head: "Serial number", cell: (each) => serialOf(camera(each)) },
    { head: "Started", cell: startOf },
    { head: "Project", cell: (each) => each.project_number ?? "" },
  ];
  const name = h("input", { id: "rig-name", required: true, maxlength: 100 });
  const button = h("button", { type: "submit", class: "primary" }, "Register the rig");
  return h("form", { class: "card", onsubmit: (event) => (event.preventDefault(), act(button, () => register(new FormData(event.target), campaigns, name.value))) },
    field("Name", name, null, about("NewRig", "name")),
    table(columns, campaigns, { caption: "Campaigns to choose from" }),
    h("p", { class: "small muted" }, "Pictures of one trigger have one scene; without scenes, times that agree within 1 s."),
    h("p", { class: "actions" }, button),
  );
}

async function register(values, campaigns, name) {
  const reference = values.get("reference");
  const ids = new Set([reference, ...values.getAll("campaign")]);
  const chosen = [...ids].map((id) => campaigns.find((each) => each.id === id));
  if (chosen.length < 2) throw wrong("Choose the campaigns of two cameras or more.");
  const rig = await post("/v1/rigs", { name, camera_ids: chosen.map((each) => each.camera_id) });
  const versions = await Promise.all(chosen.map((each) => get(`/v1/campaigns/${each.id}/calibrations`)));
  const newest = versions.map(({ items }) => items.reduce((last, each) => (last && last.version > each.version ? last : each), undefined));
  // published versions are found by the service; drafts have to be named
  const named = newest.every(Boolean) && newest.some((each) => each.state === "draft");
  const query = new URLSearchParams(newest.filter(Boolean).map((each) => ["calibration_id", each.id]));
  await leave(`/rigs/${rig.id}${named ? `?${query}` : ""}`);
}
