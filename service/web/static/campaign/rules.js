// Role and scene of a file by its name: the same patterns as in campaign.toml.

import { ROLES } from "./methods.js";

const PARTS = { "{scene}": "(?<scene>[^/]+)", "**/": "(?:.*/)?", "*": "[^/]*", "?": "[^/]" };

/** The rules that hold until somebody writes others: folders and names that mean a role, then folders as scenes. */
export function usualRules(roles, usual) {
  const named = ROLES.filter((role) => !["light", "field", usual].includes(role) && roles.includes(role));
  const rules = named.flatMap((role) => [{ pattern: `**/${role}*/*`, role }, { pattern: `*${role}*`, role }]);
  // every campaign has frames to measure beside those to fit; by the folder alone, as a flat field is none
  rules.push({ pattern: "**/field*/*", role: "field" });
  return [...rules, ...(roles.includes("light") ? [{ pattern: "**/{scene}/*", role: "light" }] : []), { pattern: "*", role: usual }];
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
