// What a fit still needs, and what would make it better: one line per cause, with the button that mends it.

import { causeFold, small, smallLink } from "../causes.js";
import { h, may } from "../dom.js";

/** Named in place of a part of the page: a dialog, which the page opens. */
const PANEL = "panel";
const FRAMES = ["frames", "Add frames"];
const OF_READINGS = ["reading_missing", "reading_off", "reading_far_from_frames", "reading_without_frames", "meter_repeatability_estimated", "meter_certificate_missing", "lamp_drift", "rho_cross_check"];
/** By the code of a cause, the part of the campaign's page that mends it; frames mend the others. */
const PARTS = {
  no_region: ["region", "Draw region"], target_missing: ["target", "Describe target"], scene_missing: ["frames", "Choose scenes"], lens_differs: ["frames", "Show frames"],
  panel_unknown: [PANEL, "Choose panel…"], panel_uncertainty_missing: [PANEL, "Choose panel…"],
  ...Object.fromEntries(OF_READINGS.map((code) => [code, ["readings", "Enter readings"]])),
};
const MARKS = { error: "warn", warn: "gap" };

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** The first sentences, and the names of what the others are about: "scene Scene 4" without the kind. */
const MOST = 3;
const tell = (said, others) => [...said.slice(0, MOST), ...(said.length > MOST ? [`also ${[...new Set(others.map((subject) => subject.replace(/^(\w+) (?=\1\b)/i, "")))].join(", ")}`] : [])].join("; ");

const isComing = ({ frames }, sending) => sending || frames.being_read > 0;

/** What a person can mend, of one severity or of all, as [{code, mark, title, where, part, button}]. */
export function causesOf(campaign, severity, sending = false) {
  const lines = campaign.causes.filter((cause) => (severity ? cause.severity === severity : cause.severity in MARKS)).map(({ code, severity: of, sentence, detail, subjects, values }) => {
    const [part, button] = PARTS[code] ?? FRAMES;
    const said = [...new Set(values.detail ?? [])];
    return { code, mark: MARKS[of], title: capital(said.length ? sentence : detail).replace(/\.$/, ""), where: tell(said.map(capital), subjects.filter((_, at) => !said.slice(0, MOST).includes(values.detail?.[at]))), part, button };
  });
  return isComing(campaign, sending) ? lines.filter(({ code, part }) => part !== "frames" && code !== "reading_without_frames") : lines;
}

/** What keeps a fit from starting: {count, said}; nothing of it is called missing while it is on its way. */
export function readinessOf(campaign, sending) {
  const count = causesOf(campaign, "error", sending).length;
  return { count, said: count ? `${count} missing` : isComing(campaign, sending) || campaign.causes.some((each) => each.severity === "pending") ? "waiting for frames" : "ready" };
}

/** The list before a fit: what was refused, what is needed, and what would improve it; the panel is asked for. */
export function beforeTheFit(campaign, title, { refused, sending, askForPanel }) {
  const line = ({ mark, title: said, where, part, button }) => ({ mark, title: said, where, tag: mark === "warn" ? h("span", { class: "tag warn" }, "needed") : null, actions: may(part === "frames" ? "upload" : "calibrate") ? [part === PANEL ? small(button, askForPanel) : smallLink(button, `#${part}`)] : [] });
  const lines = [...refused, ...causesOf(campaign, "", sending).map(line)];
  if (!lines.length) return null;
  return h(
    "section",
    { id: "before", class: "tight", "aria-labelledby": "before-head" },
    h("div", { class: "section-head" }, h("h2", { id: "before-head" }, title), h("p", {}, lines.some(({ mark }) => mark !== "gap") ? "" : "Nothing is needed; these lines would improve it")),
    causeFold(lines, 4),
  );
}
