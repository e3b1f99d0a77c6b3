// Flags in words.

import { h } from "./dom.js";
import { tag } from "./format.js";
import { groupBy } from "./groups.js";

/** Each flag once, in words, with where it was raised and what was found. */
export function drawFlags(flags, meanings) {
  const raised = groupBy(flags, (each) => each.flag);
  if (!raised.size) return h("p", { class: "note good" }, "No flags.");
  return h(
    "ul",
    { class: "todo flags" },
    [...raised].map(([flag, found]) =>
      h(
        "li",
        {},
        h("div", { class: "todo-head" }, h("strong", {}, meanings[flag]), tag(flag, "warn")),
        found.length > 3
          ? h("details", {}, h("summary", {}, `${found.length} places`), h("ul", {}, found.map(place)))
          : h("ul", {}, found.map(place)),
      ),
    ),
  );
}

const place = ({ where, detail }) => h("li", {}, where ? h("span", { class: "muted" }, `${where.replace(/^iso /, "ISO ")}: `) : null, detail);
