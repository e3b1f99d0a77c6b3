// One line per cause, with the button that mends it.

import { h, mark, prose } from "./dom.js";
import { tag, typeset } from "./format.js";

/** Each finding once, in words, with where it was raised, what was found and what to do. */
export function drawFindings(findings) {
  if (!findings.length) return h("p", { class: "note good" }, "No flags.");
  return h(
    "ul",
    { class: "todo flags" },
    findings.map((finding) => {
      const { code, sentence, action, count, subjects } = finding;
      const places = h("ul", {}, subjects.map((where, at) => place(where, detailOf(finding, at))));
      return h(
        "li",
        {},
        h("div", { class: "todo-head" }, h("strong", {}, prose(typeset(sentence))), tag(code, "warn")),
        count > 3 ? h("details", {}, h("summary", {}, `${count} places`), places) : places,
        h("p", { class: "muted" }, prose(typeset(action))),
      );
    }),
  );
}

/** What was found at a subject, beyond the sentence of the finding. */
export const detailOf = ({ detail, sentence, values }, at) => values.detail?.[at] ?? (detail === sentence ? "" : detail);

const place = (where, detail) => h("li", {}, where ? h("span", { class: "muted" }, `${where.replace(/^iso /, "ISO ")}: `) : null, prose(typeset(detail)));

/** [{mark, title, where?, tag?, actions: [element]}] as a list. */
export const causeList = (causes) =>
  h("ul", { class: "causes" }, causes.map((cause) => h("li", {}, mark(cause.mark), h("p", {}, h("strong", {}, prose(typeset(cause.title)), "."), cause.where ? h("span", { class: "where" }, " ", prose(typeset(cause.where))) : null, cause.tag ? [" ", cause.tag] : null), cause.actions?.length ? h("span", { class: "actions" }, cause.actions) : null)));

/** The first causes, and the others folded. */
export const causeFold = (causes, most = 6) => [causeList(causes.slice(0, most)), causes.length > most ? h("details", { class: "more" }, h("summary", {}, `${causes.length - most} more`), causeList(causes.slice(most))) : null];

/** A small button of such a line. */
export const small = (text, onclick, { quiet = false, ...more } = {}) => h("button", { type: "button", class: `small-button${quiet ? " quiet" : ""}`, onclick, ...more }, text);
export const smallLink = (text, href) => h("a", { class: "button small-button", href }, text);
