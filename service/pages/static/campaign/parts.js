// The parts of a campaign's page that come after its frames, each with its place there.

import { calibrateSection } from "./calibrate.js";
import { checklistSection } from "./checklist.js";
import { detailsPart } from "./details.js";
import { inTimePart } from "./in-time.js";
import { nightSection } from "./night.js";
import { regionSection } from "./region.js";
import { targetSection } from "./target.js";

export { uploadSection } from "./upload.js";

export const PARTS = [
  ["details-buttons", detailsPart],
  ["in-time", inTimePart],
  ["target-form", targetSection],
  ["region-tool", regionSection],
  ["checklist-items", checklistSection],
  ["calibrate-tool", calibrateSection],
  ["night-tool", nightSection],
];
