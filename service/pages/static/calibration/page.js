// One version: loaded once, drawn part by part, and redrawn after each decision.

import { all, get, getOr } from "../api.js";
import { byId, fill, h } from "../dom.js";
import { labelOf } from "../methods.js";
import { empty, failed, load } from "../states.js";
import { drawFindings } from "../flags.js";
import { drawBudget, drawModels, reportedModel } from "./detail.js";
import { offerDecisions } from "./decide.js";
import { drawStatus, drawVerdict } from "./result.js";
import { drawHistory, drawMade, drawSiblings } from "./record.js";
import { drawPlots } from "./curves.js";
import { drawPoints } from "./points.js";
import { Choice } from "./choice.js";

const main = document.querySelector("main");
const { calibrationId: id, method } = main.dataset;
const choice = new Choice();

start();

async function start() {
  const calibration = get(`/v1/calibrations/${id}`);
  showStatus(calibration);
  load(byId("verdict"), () => calibration, drawVerdict);
  load(byId("flags"), async () => (await calibration).findings, drawFindings);
  load(byId("points"), () => calibration, (found) => drawPoints(found, choice));
  load(byId("made"), () => calibration, drawMade);
  try {
    const found = await calibration;
    show("models", drawModels(found));
    fill(byId("models-note"), reportedModel(found));
    show("budget", drawBudget(found));
    choice.offer(found);
    drawPlots(found, choice);
    if (byId("drawn")) drawOwnPlot();
  } catch (error) {
    // each region tells it
    if (!error.code) throw error;
  }
}

/** State, history and what can be decided: what a decision changes. */
function showStatus(calibration) {
  load(byId("version-status"), () => withSuccessor(calibration), drawStatus);
  load(
    byId("history"),
    async () => {
      const found = await calibration;
      return get(`/v1/cameras/${found.camera_id}/decisions`);
    },
    ({ items }) => drawHistory(items.filter((each) => each.calibration_id === id)),
  );
  load(
    byId("siblings"),
    async () => {
      const found = await calibration;
      return [found, await all(`/v1/campaigns/${found.campaign_id}/calibrations`)];
    },
    ([found, versions]) => drawSiblings(found, versions),
  );
  calibration.then(
    (found) => offerDecisions(byId("decide"), found, (said) => (fill(byId("said"), said), showStatus(get(`/v1/calibrations/${id}`)))),
    () => {},
  );
}

async function withSuccessor(calibration) {
  const found = await calibration;
  return [found, found.superseded_by ? await getOr(`/v1/calibrations/${found.superseded_by}`, undefined) : undefined];
}

function show(name, drawn) {
  byId(`${name}-section`).hidden = !drawn;
  if (drawn) fill(byId(name), drawn);
}

async function drawOwnPlot() {
  const place = byId("drawn");
  const address = `/v1/calibrations/${id}/plot.svg`;
  const picture = h("img", { class: "own-plot", src: address, alt: `Plot of this ${labelOf(method)} calibration` });
  picture.addEventListener("error", async () => {
    const answer = await getOr(address, undefined).catch((error) => error);
    fill(place, answer?.code ? failed(answer, drawOwnPlot) : empty("No plot", "This version has nothing to plot."));
  });
  fill(place, picture);
}
