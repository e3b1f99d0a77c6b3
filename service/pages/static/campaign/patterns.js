// Role and scene by the file's name: rules that the browser remembers for this campaign.

import { fill, h } from "../dom.js";
import { roleOptions } from "../methods.js";
import { select } from "../ask.js";

const PARTS = { "{scene}": "(?<scene>[^/]+)", "**/": "(?:.*/)?", "*": "[^/]*", "?": "[^/]" };

/** The rules that hold until somebody writes others: folders and names that mean a role, then folders as scenes. */
function usualRules([usual, ...roles]) {
  const named = roles.filter((role) => role.used_in_fit && !role.has_scene);
  const rules = named.flatMap(({ name: role }) => [{ pattern: `**/${role}*/*`, role }, { pattern: `*${role}*`, role }]);
  // every campaign has frames to measure beside those to fit; by the folder alone, as a flat field is none
  rules.push({ pattern: "**/field*/*", role: "field" });
  const scene = [usual, ...roles].find((role) => role.has_scene);
  return [...rules, ...(scene ? [{ pattern: "**/{scene}/*", role: scene.name }] : []), { pattern: "*", role: usual.name }];
}

/** {role, scene} by the first rule that fits a path such as "level-1/DJI_0001.DNG", or undefined. */
export function judge(path, rules) {
  for (const { pattern, role, scene } of rules) {
    const subject = pattern.includes("/") ? path : path.slice(path.lastIndexOf("/") + 1);
    const found = regular(pattern).exec(subject);
    if (found) return { role, scene: scene || (role === "dark" ? undefined : found.groups?.scene) };
  }
  return undefined;
}

function regular(pattern) {
  let named = false;
  const source = pattern
    .split(/(\{scene\}|\*\*\/|\*|\?)/)
    .map((part) => {
      if (part === "{scene}" && named) return "[^/]+";
      named ||= part === "{scene}";
      return PARTS[part] ?? part.replace(/[.+^$()|[\]\\{}]/g, "\\$&");
    })
    .join("");
  return new RegExp(`^${source}$`, "i");
}

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
  const draw = () => fill(rows,
    own.map((rule) => h("div", { class: "pattern-row" },
      h("input", { "aria-label": "Pattern", "aria-describedby": "patterns-hint", value: rule.pattern ?? "", placeholder: "*dark*", spellcheck: "false", onchange: (event) => ((rule.pattern = event.target.value.trim()), keep()) }),
      select(roleOptions(state.method), { "aria-label": "Role", "aria-describedby": "patterns-hint", onchange: (event) => ((rule.role = event.target.value), keep()) }, rule.role),
      h("input", { "aria-label": "Scene", "aria-describedby": "patterns-hint", value: rule.scene ?? "", placeholder: "from {scene}", onchange: (event) => ((rule.scene = event.target.value.trim() || undefined), keep()) }),
      h("button", { type: "button", class: "quiet", "aria-label": "Remove this pattern", onclick: () => ((own = own.filter((each) => each !== rule)), draw(), keep()) }, "Remove"),
    )),
  );
  const add = () => {
    own.push({ pattern: "", role: state.method.roles[0].name, fresh: true });
    draw();
    rows.lastElementChild.querySelector("input").focus();
  };
  draw();
  const element = h("details", { class: "patterns", open: own.length > 0 },
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
