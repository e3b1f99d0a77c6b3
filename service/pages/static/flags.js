// Findings in words.

import { h, prose } from "./dom.js";
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
