// Role and scene by the file's name: rules that the browser remembers for this campaign.

import { fill, h } from "../dom.js";
import { roleOptions } from "../methods.js";
import { select } from "./forms.js";
import { usualRules } from "./rules.js";

/** {element, rules()}; `changed` is called when somebody has written others. */
export function patternsPart(state, changed) {
  const slot = `stilb-patterns ${state.id}`;
  const usual = usualRules(state.method.roles);
  let own = read(slot);
  const rows = h("div", { class: "pattern-rows" });
  const keep = () => {
    own = own.filter((rule) => rule.pattern || rule.fresh);
    try {
      localStorage.setItem(slot, JSON.stringify(own.filter((rule) => rule.pattern)));
    } catch {
      // a browser that keeps nothing: the rules hold until the page is left
    }
    changed();
  };
  const draw = () =>
    fill(
      rows,
      own.map((rule) =>
        h(
          "div",
          { class: "pattern-row" },
          h("input", { "aria-label": "Pattern", "aria-describedby": "patterns-hint", value: rule.pattern ?? "", placeholder: "*dark*", spellcheck: "false", onchange: (event) => ((rule.pattern = event.target.value.trim()), keep()) }),
          select(roleOptions(state.method), { "aria-label": "Role", "aria-describedby": "patterns-hint", onchange: (event) => ((rule.role = event.target.value), keep()) }, rule.role),
          h("input", { "aria-label": "Scene", "aria-describedby": "patterns-hint", value: rule.scene ?? "", placeholder: "from {scene}", onchange: (event) => ((rule.scene = event.target.value.trim() || undefined), keep()) }),
          h("button", { type: "button", class: "quiet", "aria-label": "Remove this pattern", onclick: () => ((own = own.filter((each) => each !== rule)), draw(), keep()) }, "Remove"),
        ),
      ),
    );
  const add = () => {
    own.push({ pattern: "", role: state.method.roles[0].name, fresh: true });
    draw();
    rows.lastElementChild.querySelector("input").focus();
  };
  draw();
  const element = h(
    "details",
    { class: "patterns", open: own.length > 0 },
    h("summary", {}, "Role and scene by pattern"),
    h("p", { class: "hint", id: "patterns-hint" }, "The first matching pattern applies: * matches any letters, ? one letter, and {scene} captures the scene, as in {scene}-*.DNG or {scene}/*. Other files are assigned by folder and name, and each file can be set in the list."),
    h("ul", { class: "plain hint" }, state.method.roles.map((role) => h("li", {}, h("strong", {}, role.label), `: ${role.description}`))),
    rows,
    h("button", { type: "button", class: "quiet", onclick: add }, "Add a pattern"),
  );
  return { element, rules: () => [...own.filter((rule) => rule.pattern), ...usual] };
}

function read(slot) {
  try {
    return JSON.parse(localStorage.getItem(slot)) ?? [];
  } catch {
    return [];
  }
}
