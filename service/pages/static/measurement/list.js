// All measurements, newest first; two of a kind can be compared.

import { all, get, pathOf } from "../api.js";
import { optionsOf } from "../ask.js";
import { titleOf as titleOfCampaign } from "../methods.js";
import { act, byId, empty, failed, fill, h, load, may } from "../dom.js";
import { measurementTable, titleOf } from "./words.js";

const form = byId("filters");
const asked = new URL(location.href).searchParams;
const chosen = new Map();
let rows = [];
let next = null;

offerFilters();
show();
form.addEventListener("change", () => {
  const said = new URLSearchParams([...new FormData(form)].filter(([, value]) => value));
  history.replaceState(null, "", said.size ? `?${said}` : location.pathname);
  show();
});

async function offerFilters() {
  try {
    const [cameras, campaigns] = await Promise.all([all("/v1/cameras"), all("/v1/campaigns")]);
    offer("camera_id", cameras.map((each) => [each.id, `${each.model} ${each.serial}`]));
    offer("campaign_id", campaigns.reverse().map((each) => [each.id, titleOfCampaign(each)]));
  } catch (error) {
    if (!error.code) throw error;
    form.after(failed(error));
  }
}

function offer(name, options) {
  form.elements[name].append(...optionsOf(options, asked.get(name)));
}

function show() {
  const said = new URL(location.href).searchParams;
  const query = new URLSearchParams(["camera_id", "campaign_id"].filter((name) => said.get(name)).map((name) => [name, said.get(name)]));
  load(byId("measurements"),
    async () => {
      const page = await get(`/v1/measurements?${new URLSearchParams([...query, ["limit", "100"]])}`);
      const wanted = said.get("compare");
      if (wanted && !chosen.size) {
        const found = page.items.find((each) => each.id === wanted) ?? (await get(`/v1/measurements/${wanted}`));
        chosen.set(found.id, found);
      }
      return page;
    },
    (page) => {
      ({ items: rows, next } = page);
      drawPair();
      return rows.length ? draw() : none(query.size);
    },
  );
}

const none = (filtered) =>
  filtered
    ? empty("No measurements", "Select another camera or campaign.")
    : empty("No measurements yet", "Send a field frame to a campaign, and measure it with the calibration of its camera.", may("upload") ? h("a", { class: "button primary", href: "/measurements/new" }, "Measure a frame") : h("a", { class: "button", href: "/campaigns" }, "Campaigns"));

function draw() {
  const pick = { head: h("span", { class: "hidden" }, "Compare"), class: "pick", cell: box };
  const more = h("button", { type: "button" }, "Show more");
  more.addEventListener("click", () => act(more, async () => {
    const page = await get(pathOf(next));
    rows = [...rows, ...page.items];
    next = page.next;
    fill(byId("measurements"), draw());
  }));
  return [measurementTable(rows, pick), next ? h("p", { class: "more" }, more) : null];
}

function box(row) {
  return h("input", { type: "checkbox", checked: chosen.has(row.id), "data-id": row.id, "aria-label": `Compare ${row.filename}`, onchange: (event) => {
    if (event.target.checked) chosen.set(row.id, row);
    else chosen.delete(row.id);
    // the first of three is replaced
    if (chosen.size > 2) chosen.delete(chosen.keys().next().value);
    for (const each of document.querySelectorAll("input[data-id]")) each.checked = chosen.has(each.dataset.id);
    drawPair();
  } });
}

function drawPair() {
  const bar = byId("pair");
  bar.hidden = !chosen.size;
  if (bar.hidden) return;
  const pair = [...chosen.values()].sort((a, b) => (a.taken_at ?? a.created_at).localeCompare(b.taken_at ?? b.created_at));
  const alike = pair.length === 2 && titleOf(pair[0]) === titleOf(pair[1]);
  fill(bar,
    h("p", {}, pair.length === 2 ? [h("strong", {}, pair[0].filename), " against ", h("strong", {}, pair[1].filename)] : [h("strong", {}, pair[0].filename), h("span", { class: "muted" }, " against another: choose one more")]),
    h("span", { class: "actions" },
      h("button", { type: "button", class: "quiet", onclick: () => {
        chosen.clear();
        for (const each of document.querySelectorAll("input[data-id]")) each.checked = false;
        drawPair();
      } }, "Clear"),
      pair.length === 2 ? (alike ? h("a", { class: "button primary", href: `/measurements/comparison?old=${pair[0].id}&new=${pair[1].id}` }, "Compare") : h("span", { class: "muted" }, "Only measurements of the same quantity can be compared.")) : null,
    ),
  );
}
