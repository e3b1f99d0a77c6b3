// What a fit still needs, and what would make it better: one line per cause, with the button that mends it.

import { causeList, small, smallLink } from "../causes.js";
import { h, may } from "../dom.js";
import { groupBy } from "../groups.js";

/** Named in place of a part of the page: a dialog, which the page opens. */
const PANEL = "panel";
/** What a sentence of the service is about, and the part of the campaign's page that mends it; none for what a worker does. */
const PARTS = [
  [/\byet\b|read again/, null, null],
  [/region/, "region", "Draw region"],
  [/panel.* (reflectance|uncertainty)/, PANEL, "Choose panel…"],
  [/target|say what/, "target", "Describe target"],
  [/reading/, "readings", "Enter readings"],
  [/no scene/, "frames", "Choose scenes"],
  [/./, "frames", "Add frames"],
];

const MOST_NAMED = 6;
const listed = (names, between = ", ") => `${names.slice(0, MOST_NAMED).join(between)}${names.length > MOST_NAMED ? ` and ${names.length - MOST_NAMED} more` : ""}`;

/** Names and numbers aside, the same sentence is the same cause; names follow a colon. */
const causeOf = (sentence) => sentence.split(": ")[0].replace(/\d+(\.\d+)?/g, "0");

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** [{title, where, part, button}] of sentences. */
export function missingCauses(sentences) {
  return [...groupBy(sentences, causeOf).values()].map((some) => {
    const [first, ...more] = some;
    const [, part, button] = PARTS.find(([pattern]) => pattern.test(first));
    const [title, ...rest] = first.split(": ");
    return { title: capital(title), where: [capital(rest.join(": ")), listed(more.map(capital), "; ")].filter(Boolean).join(". "), part, button };
  });
}

/** Findings of the campaign itself: those of frames are told with the frames. */
const ofCampaign = (findings) => findings.filter(({ subjects }) => subjects.every((each) => !each.startsWith("frame ")));

/** The list before a fit: what was refused, what is needed, and what would improve it; the panel is asked for. */
export function beforeTheFit({ missing, advice, findings = [] }, title, refused, askForPanel) {
  const found = ofCampaign(findings).map(({ detail, action, subjects }) => ({ title: detail.replace(/\.$/, ""), where: `${capital(listed(subjects))}. ${action}`, part: "readings", button: "Readings" }));
  if (!missing.length && !advice.length && !refused.length && !found.length) return null;
  const line = (mark, tag) => ({ title, where, part, button }) => ({ mark: part ? mark : "wait", title, where, tag: tag?.(), actions: part && may(part === "frames" ? "upload" : "calibrate") ? [part === PANEL ? small(button, askForPanel) : smallLink(button, `#${part}`)] : [] });
  const lines = [...refused, ...found.map(line("warn")), ...missingCauses(missing).map(line("warn", () => h("span", { class: "tag warn" }, "needed"))), ...missingCauses(advice).map(line("gap"))];
  const [shown, more] = [lines.slice(0, 6), lines.slice(6)];
  return h(
    "section",
    { id: "before", class: "tight", "aria-labelledby": "before-head" },
    h("div", { class: "section-head" }, h("h2", { id: "before-head" }, title), h("p", {}, missing.length || refused.length ? "" : "Nothing is needed; these lines would improve it")),
    causeList(shown),
    more.length ? h("details", { class: "more" }, h("summary", {}, `${more.length} more`), causeList(more)) : null,
  );
}
