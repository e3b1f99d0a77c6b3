// All campaigns of the organisation, newest first.

import { all } from "../api.js";
import { byId, empty, fill, h, load, may, table } from "../dom.js";
import { isNight, kindOf, labelOf, startOf } from "../methods.js";

const WHAT = "A campaign contains the frames, the region and the meter readings of one calibration, or the frames of a measuring night.";
load(byId("campaigns"), () => Promise.all([all("/v1/campaigns"), all("/v1/cameras")]), ([campaigns, cameras]) => (campaigns.length ? list(campaigns.reverse(), new Map(cameras.map((camera) => [camera.id, camera]))) : empty("No campaigns yet", WHAT, may("calibrate") ? h("a", { class: "button primary", href: "/campaigns/new" }, "New campaign") : null)));

function list(campaigns, cameras) {
  const shown = h("div", { "aria-live": "polite" });
  const away = h("input", { type: "checkbox", onchange: () => draw() });
  const archived = campaigns.filter((each) => each.archived_at).length;
  const search = h("input", { type: "search", "aria-label": "Find a campaign", placeholder: "Project, camera, person, place" });
  const draw = () => {
    const wanted = search.value.trim().toLowerCase();
    const found = campaigns.filter((each) => Boolean(each.archived_at) === away.checked && textOf(each, cameras).includes(wanted));
    fill(shown, !wanted && !found.length ? h("p", { class: "muted" }, "All campaigns are archived.") : found.length ? apart(found, cameras) : empty("No results", `No campaign matches “${search.value}”.`));
  };
  search.addEventListener("input", draw);
  draw();
  return [archived ? h("label", { class: "check" }, away, `Archived (${archived})`) : null, campaigns.length > 8 ? h("p", { class: "search" }, search) : null, shown];
}

function apart(campaigns, cameras) {
  const nights = campaigns.filter(isNight);
  const others = campaigns.filter((each) => !isNight(each));
  const part = (title, some) => (some.length ? h("section", { class: "tight" }, h("h3", {}, title), rows(some, cameras, title)) : null);
  return nights.length ? [part("Calibrations", others), part("Measuring nights", nights)] : rows(others, cameras, "Campaigns");
}

function rows(campaigns, cameras, caption) {
  const columns = [
    { head: "Project", header: true, cell: (each) => h("a", { href: `/campaigns/${each.id}` }, each.project_number ?? `${isNight(each) ? "Measuring night" : labelOf(each.method)} of ${cameras.get(each.camera_id)?.model ?? "a camera"}`) },
    { head: "Method", cell: (each) => h("span", { class: "tag" }, labelOf(each.method)) },
    { head: "Camera", cell: (each) => h("a", { class: "nowrap", href: `/cameras/${each.camera_id}` }, cameraOf(each, cameras)) },
    { head: "Recorded by", cell: (each) => each.recorder ?? "–" },
    { head: "Place", cell: (each) => each.place ?? "–" },
    { head: "Started", class: "nowrap", cell: startOf },
  ];
  return table(columns, campaigns, { caption, stack: true });
}

function cameraOf(each, cameras) {
  const camera = cameras.get(each.camera_id);
  return camera ? `${camera.model} ${camera.serial}` : "–";
}

function textOf(each, cameras) {
  const words = [each.project_number, kindOf(each), each.recorder, each.place, each.customer, cameraOf(each, cameras)];
  return words.filter(Boolean).join(" ").toLowerCase();
}
