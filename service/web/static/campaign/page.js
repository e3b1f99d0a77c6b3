// The page of one campaign, from its first file to its calibration.

import { byId, fill, may } from "../dom.js";
import { failed, load } from "../states.js";
import { calibrateSection } from "./calibrate.js";
import { checklistSection } from "./checklist.js";
import { framesSection } from "./frames.js";
import { overview } from "./overview.js";
import { readingsSection } from "./readings.js";
import { regionSection } from "./region.js";
import { CampaignState } from "./state.js";
import { uploadSection } from "./upload.js";

const { campaignId, room } = document.querySelector("main").dataset;
const state = new CampaignState(campaignId, JSON.parse(room));

const parts = [
  ["overview", overview],
  ["frame-list", framesSection],
  ["region-tool", regionSection],
  ["reading-list", readingsSection],
  ["checklist-items", checklistSection],
  ["calibrate-tool", calibrateSection],
];

if (may("upload")) fill(byId("upload"), uploadSection(state));
start();

async function start() {
  const first = byId("overview");
  if (!(await load(first, () => state.open(), () => null))) return;
  for (const [id, part] of parts) {
    const place = byId(id);
    try {
      fill(place, part(state));
    } catch (error) {
      fill(place, failed(error));
    }
    place.removeAttribute("aria-busy");
  }
  // what the address names has only now got its place
  if (location.hash) document.querySelector(`section${CSS.escape(location.hash).replace("\\#", "#")}`)?.scrollIntoView();
}
