// Frames that are moved, left out, withdrawn and restored; each change can be undone.

import { ask } from "../ask.js";
import { done, h } from "../dom.js";
import { counted } from "../format.js";
import { groupBy } from "../groups.js";
import { roleLabel, roleOptions } from "../methods.js";
import { wrong } from "../states.js";
import { readNumber } from "./forms.js";

const name = (state, ids) => (ids.length === 1 ? state.byId.get(ids[0]).filename : counted(ids.length, "frame"));

/** What a file may not state, as a camera with a manual lens does not. */
export const EXPOSURE = [["exposure_time_s", "Exposure time [s]"], ["f_number", "f-number"], ["iso", "ISO"]];

const KEYS = ["role", "scene", "left_out", "withdrawn"];

/** Change frames alike, and offer the way back: each frame as it was. What another user has changed meanwhile is not changed. */
export async function changeFrames(state, ids, said, text) {
  const keys = KEYS.filter((key) => key in said || key === "withdrawn");
  const groups = groupBy(ids, (id) => {
    const frame = state.byId.get(id);
    const was = { role: frame.role, scene: frame.scene ?? "", left_out: frame.left_out !== null, withdrawn: frame.withdrawn };
    return JSON.stringify({ ...Object.fromEntries(keys.map((key) => [key, was[key]])), ...("left_out" in said && frame.left_out ? { reason: frame.left_out } : {}) });
  });
  const each = async (step) => {
    for (const [was, some] of groups) {
      const { reason, ...expected } = JSON.parse(was);
      await step(some, expected, reason);
    }
  };
  await each((some, expected) => state.change(some, said, expected));
  const made = Object.fromEntries(KEYS.filter((key) => key in said).map((key) => [key, said[key]]));
  done(text(name(state, ids)), () => each((some, was, reason) => state.change(some, { ...was, ...(reason ? { reason } : {}) }, { withdrawn: was.withdrawn, ...made })));
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

/** Ask for the exposure of several frames at once; they are read again. */
export function askExposure(state, ids) {
  return ask({
    title: `Exposure of ${name(state, ids)}`,
    fields: EXPOSURE.map(([key, label]) => ({ name: key, label, of: "FrameChange", required: false, inputmode: "decimal", autocomplete: "off" })),
    after: h("p", { class: "hint" }, "What a file states itself is not replaced. Select some frames in the grid to enter another value for them."),
    submit: "Read again",
    action: async (values) => {
      const typed = Object.entries(values).map(([key, text]) => [key, readNumber(text)]);
      if (!typed.length || typed.some(([, value]) => !(value > 0))) throw wrong("Enter at least one value, each a number above 0.");
      await state.change(ids, Object.fromEntries(typed));
    },
  });
}
