// The page of one campaign, from its first file to its calibration.

import { byId, fill, may } from "../dom.js";
import { atNight, methodOf } from "../methods.js";
import { failed } from "../states.js";
import { gridSection } from "./grid.js";
import { overview } from "./overview.js";
import { CampaignState } from "./state.js";

const { campaignId, method, kind } = document.querySelector("main").dataset;
const state = new CampaignState(campaignId, kind === "measurement" ? atNight(methodOf(method)) : methodOf(method));

start();

async function start() {
  // the frames are there first, and are drawn before anything else is asked
  const known = (await drawn("frame-list", () => state.open(), gridSection)) && (await drawn("overview", () => state.know(), overview));
  // all that a slow line brings after them
  const { PARTS, uploadSection } = await import("./parts.js");
  if (state.left) return;
  if (may("upload")) fill(byId("upload"), uploadSection(state));
  if (!known) {
    for (const place of document.querySelectorAll("main .region[aria-busy]")) fill(place).removeAttribute("aria-busy");
    return;
  }
  // a method that has no readings has no such part; the form is there where no target is
  for (const [id, part] of PARTS) if (byId(id)) await drawn(id, () => {}, part);
  // what the address names has only now got its place
  if (location.hash) document.querySelector(`section${CSS.escape(location.hash).replace("\\#", "#")}`)?.scrollIntoView();
}

/** One part, once what it shows is there; if that fails, everything begins again. */
async function drawn(id, ready, part) {
  const place = byId(id);
  try {
    await ready();
    if (state.left) return false;
    fill(place, part(state));
    return true;
  } catch (error) {
    fill(place, failed(error, () => location.reload()));
    return false;
  } finally {
    place.removeAttribute("aria-busy");
  }
}
