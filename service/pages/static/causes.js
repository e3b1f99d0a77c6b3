// One line per cause, with the button that mends it.

import { h, mark, may, prose } from "./dom.js";
import { capital, counted, tag, typeset } from "./format.js";
import { nameOf } from "./methods.js";

/** Each finding once, in words, with where it was raised, what was found and what to do. */
export function drawFindings(findings) {
  if (!findings.length) return h("p", { class: "note good" }, "No flags.");
  return h("ul", { class: "todo flags" }, findings.map((finding) => {
    const { code, sentence, action, count, subjects } = finding;
    const places = h("ul", {}, subjects.map((where, at) => place(where, detailOf(finding, at))));
    return h("li", {},
      h("div", { class: "todo-head" }, h("strong", {}, prose(typeset(sentence))), tag(code, "warn")),
      count > 3 ? h("details", {}, h("summary", {}, `${count} places`), places) : places,
      h("p", { class: "muted" }, prose(typeset(action))),
    );
  }));
}

/** What was found at a subject, beyond the sentence of the finding. */
export const detailOf = ({ detail, sentence, values }, at) => values.detail?.[at] ?? (detail === sentence ? "" : detail);

const place = (where, detail) => h("li", {}, where ? h("span", { class: "muted" }, `${where.replace(/^iso /, "ISO ")}: `) : null, prose(typeset(detail)));

/** [{mark, title, where?, tag?, actions: [element]}] as a list. */
export const causeList = (causes) =>
  h("ul", { class: "causes" }, causes.map((cause) => h("li", {}, mark(cause.mark), h("p", {}, h("strong", {}, prose(typeset(cause.title)), "."), cause.where ? h("span", { class: "where" }, " ", prose(typeset(cause.where))) : null, cause.tag ? [" ", cause.tag] : null), cause.actions?.length ? h("span", { class: "actions" }, cause.actions) : null)));

export const causeFold = (causes, most = 6) => [causeList(causes.slice(0, most)), causes.length > most ? h("details", { class: "more" }, h("summary", {}, `${causes.length - most} more`), causeList(causes.slice(most))) : null];

export const small = (text, onclick, { quiet = false, ...more } = {}) => h("button", { type: "button", class: `small-button${quiet ? " quiet" : ""}`, onclick, ...more }, text);
export const smallLink = (text, href) => h("a", { class: "button small-button", href }, text);

/** A cause of `GET /v1/jobs/causes` as a line; `works`: the campaigns by name. */
export function jobCause({ count, newest: { kind, state, error, campaign_id: id, filename } }, works) {
  // of a fit that failed the title says no more
  const why = kind === "extract" && error?.title ? `: ${error.title.charAt(0).toLowerCase()}${error.title.slice(1)}`.replace(/\.$/, "") : "";
  const what = kind === "fit" ? (count > 1 ? `${count} fits failed` : "A fit failed") : kind === "extract" ? `${counted(count, "frame")} refused` : `${counted(count, "measurement")} failed`;
  const about = [id && nameOf(works, id), filename && (count > 1 ? `${filename} and ${count - 1} more` : filename)].filter(Boolean).join(", ");
  return {
    mark: "bad",
    title: `${what}${why}`,
    where: [about, error?.detail].filter(Boolean).join(": ") + (state === "quarantined" ? " Stopped after 3 attempts." : ""),
    actions: [id ? smallLink(filename ? "Show frames" : "Show campaign", `/campaigns/${id}${filename ? "#frames" : ""}`) : smallLink("Show jobs", "/jobs")],
  };
}

const FRAMES = ["frames", "Add frames"];
const OF_READINGS = ["reading_missing", "reading_off", "reading_far_from_frames", "reading_without_frames", "meter_repeatability_estimated", "lamp_drift", "rho_cross_check"];
/** By the code of a cause, the part of the campaign's page that mends it, or a dialog; frames mend the others. */
const PARTS = {
  no_region: ["region", "Draw region"], target_missing: ["target", "Describe target"], scene_missing: ["frames", "Choose scenes"], lens_differs: ["frames", "Show frames"], spectral_mismatch_unknown: ["calibrate", "State the lamp"], pixel_pitch_missing: ["camera", "Show camera"],
  meter_certificate_missing: ["meter", "State the meter…"], panel_unknown: ["panel", "Choose panel…"], panel_uncertainty_missing: ["panel", "Choose panel…"],
  ...Object.fromEntries(OF_READINGS.map((code) => [code, ["readings", "Enter readings"]])),
};
const MARKS = { error: "warn", warn: "gap" };


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

/** The list before a fit: what was refused, what is needed, and what would improve it; the panel and the meter are asked for. */
export function beforeTheFit(campaign, title, { refused, sending, dialogs }) {
  const line = ({ mark, title: said, where, part, button }) => ({ mark, title: said, where, tag: mark === "warn" ? h("span", { class: "tag warn" }, "needed") : null, actions: may(part === "frames" ? "upload" : "calibrate") ? [dialogs[part] ? small(button, dialogs[part]) : smallLink(button, `#${part}`)] : [] });
  const lines = [...refused, ...causesOf(campaign, "", sending).filter(({ code }) => code !== "frame_not_read" || !refused.length).map(line)];
  if (!lines.length) return null;
  return h("section", { id: "before", class: "tight", "aria-labelledby": "before-head" },
    h("div", { class: "section-head" }, h("h2", { id: "before-head" }, title), h("p", {}, lines.some(({ mark }) => mark !== "gap") ? "" : "Nothing is needed; these lines would improve it")),
    causeFold(lines, 4),
  );
}
