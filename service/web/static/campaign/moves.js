// Frames that are moved, left out, withdrawn and restored; each change can be undone.

import { ask } from "../ask.js";
import { counted } from "../format.js";
import { roleLabel, roleOptions } from "../methods.js";
import { done } from "../undo.js";

const name = (state, ids) => (ids.length === 1 ? state.byId.get(ids[0]).filename : counted(ids.length, "frame"));

/** Change frames alike, and offer the way back: each frame as it was. */
export async function changeFrames(state, ids, said, text) {
  const before = new Map();
  for (const id of ids) {
    const frame = state.byId.get(id);
    const was = { role: frame.role, scene: frame.scene ?? "", left_out: frame.left_out !== null, reason: frame.left_out || undefined, withdrawn: frame.withdrawn };
    const kept = Object.fromEntries(Object.keys({ ...said, ...("left_out" in said ? { reason: "" } : {}) }).map((key) => [key, was[key]]));
    const key = JSON.stringify(kept);
    before.set(key, [...(before.get(key) ?? []), id]);
  }
  await state.change(ids, said);
  done(text(name(state, ids)), async () => {
    for (const [kept, some] of before) await state.change(some, JSON.parse(kept));
  });
}

export const leaveOut = (state, ids) => {
  const out = ids.some((id) => state.byId.get(id).left_out === null);
  return changeFrames(state, ids, { left_out: out }, (named) => `${named} ${out ? "left out" : "used again"}.`);
};

export const withdraw = (state, ids) => {
  const gone = ids.some((id) => !state.byId.get(id).withdrawn);
  return changeFrames(state, ids, { withdrawn: gone }, (named) => `${named} ${gone ? "withdrawn" : "restored"}.`);
};

/** To the row of the grid, whose role or scene the frames then have. */
export function moveTo(state, ids, { role, value, label }) {
  const hasScene = state.method.grid.rows === "scene" && state.method.roles.find((each) => each.name === role)?.has_scene;
  return changeFrames(state, ids, { role, ...(hasScene ? { scene: value ?? "" } : {}) }, (named) => `${named} moved to ${label}.`);
}

/** Ask where to: a role and, for those that have one, a scene. */
export function askWhere(state, ids) {
  const [first] = ids.map((id) => state.byId.get(id));
  const scenes = state.method.grid.rows === "scene";
  return ask({
    title: `Move ${name(state, ids)}`,
    fields: [
      { name: "role", label: "Role", of: "FrameChange", options: roleOptions(state.method), value: first.role },
      ...(scenes ? [{ name: "scene", label: "Scene", of: "FrameChange", value: first.scene ?? "", required: false, list: "scenes", autocomplete: "off", hint: `In use: ${state.scenes.slice(0, 12).join(", ") || "none"}` }] : []),
    ],
    submit: "Move",
    action: ({ role, scene }) => changeFrames(state, ids, { role, ...(scenes ? { scene: scene?.trim() ?? "" } : {}) }, (named) => `${named} moved to ${scene?.trim() || `${roleLabel(role)} frames`}.`),
  });
}
