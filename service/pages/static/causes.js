// One line per cause, with the button that mends it.

import { h, prose } from "./dom.js";
import { typeset } from "./format.js";
import { mark } from "./marks.js";

/** [{mark, title, where?, tag?, actions: [element]}] as a list. */
export const causeList = (causes) =>
  h("ul", { class: "causes" }, causes.map((cause) => h("li", {}, mark(cause.mark), h("p", {}, h("strong", {}, prose(typeset(cause.title)), "."), cause.where ? h("span", { class: "where" }, " ", prose(typeset(cause.where))) : null, cause.tag ? [" ", cause.tag] : null), cause.actions?.length ? h("span", { class: "actions" }, cause.actions) : null)));

/** The first causes, and the others folded. */
export const causeFold = (causes, most = 6) => [causeList(causes.slice(0, most)), causes.length > most ? h("details", { class: "more" }, h("summary", {}, `${causes.length - most} more`), causeList(causes.slice(most))) : null];

/** A small button of such a line. */
export const small = (text, onclick, { quiet = false, ...more } = {}) => h("button", { type: "button", class: `small-button${quiet ? " quiet" : ""}`, onclick, ...more }, text);
export const smallLink = (text, href) => h("a", { class: "button small-button", href }, text);
