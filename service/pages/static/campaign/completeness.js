// Which camera is calibrated by which method: what is in force, and what the newest campaign still lacks.

import { get } from "../api.js";
import { h, table } from "../dom.js";
import { counted, day } from "../format.js";
import { inOrder } from "../groups.js";
import { inForce } from "../coefficients.js";
import { mark } from "../marks.js";
import { isNight, METHODS } from "../methods.js";
import { missingCauses } from "./missing.js";

const MOST_ASKED = 40;

/** Of each camera and method the newest campaign that is not archived, with what it lacks. */
export async function loadCompleteness(campaigns) {
  const { rows } = await get("/v1/series/coefficients");
  const newest = new Map();
  for (const each of campaigns.filter((one) => !one.archived_at && !isNight(one))) if (!newest.has(keyOf(each))) newest.set(keyOf(each), each);
  const asked = [...newest.values()].slice(0, MOST_ASKED);
  const found = await Promise.all(asked.map(({ id }) => Promise.all([get(`/v1/campaigns/${id}`), get(`/v1/campaigns/${id}/calibrations?limit=1`)])));
  return { held: inForce(rows), begun: new Map(found.map(([campaign, { items }]) => [keyOf(campaign), { campaign, fitted: items.length > 0 }])) };
}

export function drawCompleteness({ held, begun }, cameras) {
  const known = new Set([...[...begun.values()].map(({ campaign }) => campaign.camera_id), ...held.map((each) => each.camera_id)]);
  const bodies = inOrder(cameras.values(), nameOf).filter(({ id }) => known.has(id));
  const methods = METHODS.filter(({ name }) => held.some((each) => each.method === name) || [...begun.values()].some(({ campaign }) => campaign.method === name));
  const cell = (camera, method) => {
    const key = keyOf({ camera_id: camera.id, method: method.name });
    const version = held.find((each) => keyOf(each) === key);
    const lines = [version ? line("good", h("a", { href: `/calibrations/${version.calibration_id}` }, `version ${version.version}`), `since ${day(version.valid_from)}`) : null, begun.has(key) ? stateOf(begun.get(key), version) : null];
    return lines.some(Boolean) ? lines : h("span", { class: "muted" }, "–");
  };
  const columns = methods.map((method) => ({ head: method.label, cell: (camera) => cell(camera, method) }));
  return table([{ head: "Camera", header: true, cell: (camera) => h("a", { href: `/cameras/${camera.id}` }, nameOf(camera)) }, ...columns], bodies, { caption: "Completeness of each camera", stack: true });
}

/** How far the newest campaign is; nothing where its version is in force. */
function stateOf({ campaign, fitted }, version) {
  if (version?.campaign_id === campaign.id) return null;
  const link = (text) => h("a", { href: `/campaigns/${campaign.id}` }, text);
  if (fitted) return line("wait", link("fitted"), "not in force");
  const causes = missingCauses(campaign.missing);
  if (!campaign.frames.received) return line("gap", link("no frames"), "");
  return causes.length ? line("warn", link(`${counted(causes.length, "item")} missing`), causes[0].title) : line("wait", link("ready to fit"), "");
}

const line = (kind, text, note) => h("div", {}, mark(kind), " ", text, note ? h("span", { class: "sub" }, note) : null);
const keyOf = (each) => `${each.camera_id} ${each.method}`;
const nameOf = (camera) => `${camera.model} ${camera.serial}`;
