// Role and scene of a file by its name: the same patterns as in campaign.toml.

const PARTS = { "{scene}": "(?<scene>[^/]+)", "**/": "(?:.*/)?", "*": "[^/]*", "?": "[^/]" };

/** The rules that hold until somebody writes others: folders and names that mean a role, then folders as scenes. */
export function usualRules([usual, ...roles]) {
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
