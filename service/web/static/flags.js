// Flags in words.

import { get } from "./api.js";
import { h, prose } from "./dom.js";
import { tag, typeset } from "./format.js";
import { groupBy } from "./groups.js";

/** The flags, each with its entry in the registry of findings. */
export async function explainFlags(flags) {
  if (!flags.length) return [];
  const { items } = await get("/v1/findings");
  const entries = new Map(items.map((each) => [each.code, each]));
  return [...groupBy(flags, (each) => each.flag)].map(([flag, found]) => ({ found, ...(entries.get(flag) ?? { code: flag, sentence: flag }) }));
}

/** Each flag once, in words, with where it was raised, what was found and what to do. */
export function drawFlags(explained) {
  if (!explained.length) return h("p", { class: "note good" }, "No flags.");
  return h(
    "ul",
    { class: "todo flags" },
    explained.map(({ code, sentence, remedy, found }) =>
      h(
        "li",
        {},
        h("div", { class: "todo-head" }, h("strong", {}, prose(typeset(sentence))), tag(code, "warn")),
        found.length > 3
          ? h("details", {}, h("summary", {}, `${found.length} places`), h("ul", {}, found.map(place)))
          : h("ul", {}, found.map(place)),
        h("p", { class: "muted" }, prose(typeset(remedy ?? ""))),
      ),
    ),
  );
}

const place = ({ where, detail }) => h("li", {}, where ? h("span", { class: "muted" }, `${where.replace(/^iso /, "ISO ")}: `) : null, prose(typeset(detail ?? "")));
