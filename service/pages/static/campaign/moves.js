// Frames that are moved, left out, withdrawn and restored; each change can be undone.

import { ask, readNumber } from "../ask.js";
import { small, smallLink } from "../causes.js";
import { act, done, h, may, wrong } from "../dom.js";
import { counted, groupBy, typeset } from "../format.js";
import { roleLabel, roleOptions } from "../methods.js";
import { changeDetails } from "./details.js";

const name = (state, ids) => (ids.length === 1 ? state.byId.get(ids[0]).filename : counted(ids.length, "frame"));

/** What a file may not state, as a camera with a manual lens does not. */
const EXPOSURE = [["exposure_time_s", "Exposure time [s]"], ["f_number", "f-number"], ["iso", "ISO"]];

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

/** In which these frames differ, that is kept where nothing is said of it. */
export function askWhere(state, ids) {
  const frames = ids.map((id) => state.byId.get(id));
  const of = (key) => (frames.every((frame) => frame[key] === frames[0][key]) ? (frames[0][key] ?? "") : null);
  const [role, scene] = [of("role"), of("scene")];
  const inScenes = state.method.grid.rows === "scene";
  const roles = [...(role === null ? [["", "keep"]] : []), ...roleOptions(state.method)];
  return ask({
    title: `Move ${name(state, ids)}`,
    fields: [
      { name: "role", label: "Role", of: "FrameChange", options: roles, value: role ?? "", required: false },
      ...(inScenes ? [{ name: "scene", label: "Scene", of: "FrameChange", value: scene ?? "", placeholder: scene === null ? "keep" : null, required: false, list: "scenes", autocomplete: "off", hint: `In use: ${state.scenes.slice(0, 12).join(", ") || "none"}` }] : []),
    ],
    after: inScenes ? h("datalist", { id: "scenes" }, state.scenes.map((each) => h("option", { value: each }))) : null,
    submit: "Move",
    action: (values) => {
      const said = { ...(values.role ? { role: values.role } : {}), ...(inScenes && (values.scene || scene !== null) ? { scene: values.scene?.trim() ?? "" } : {}) };
      const place = [said.role && said.role !== role && `${roleLabel(said.role)} frames`, said.scene].filter(Boolean).join(", ");
      return changeFrames(state, ids, said, (named) => `${named} moved to ${place || `${roleLabel(frames[0].role)} frames`}.`);
    },
  });
}

export function askExposure(state, ids) {
  return ask({
    title: `Exposure of ${name(state, ids)}`,
    fields: EXPOSURE.map(([key, label]) => ({ name: key, label, of: "FrameChange", required: false, inputmode: "decimal", autocomplete: "off" })),
    after: h("p", { class: "hint" }, `What a file states itself is not replaced.${ids.length > 1 ? " Select some frames in the grid to enter another value for them." : ""}`),
    submit: "Read again",
    action: async (values) => {
      const typed = Object.entries(values).map(([key, text]) => [key, readNumber(text)]);
      if (!typed.length || typed.some(([, value]) => !(value > 0))) throw wrong("Enter at least one value, each a number above 0.");
      await state.change(ids, Object.fromEntries(typed));
    },
  });
}

const MOST_NAMED = 5;
const isUnlike = ({ code, outcome }) => code === "format_differs" && outcome === "fail";

/** [{mark, title, where, actions}] of the frames that were refused, and of those whose image has another size, by its sentence. */
export function refusedCauses(state) {
  return [...groupBy(state.frames.filter((frame) => frame.refusal_code || isUnlike(frame)), (frame) => frame.refusal_code ?? frame.detail)].map(([code, some]) => {
    const named = some.slice(0, MOST_NAMED).map((frame) => frame.filename).join(", ");
    return { mark: "bad", title: `${counted(some.length, "frame")} ${isUnlike(some[0]) ? "of another image size" : "refused"}`, where: `${typeset(some[0].detail ?? "")} (${named}${some.length > MOST_NAMED ? ` and ${some.length - MOST_NAMED} more` : ""})`, actions: mendButtons(state, code, some) };
  });
}

export function mendButtons(state, code, frames) {
  if (!may("calibrate")) return [];
  const doing = (work) => (event) => act(event.target, work);
  const ids = frames.map((frame) => frame.id);
  const enter = small("Enter exposure…", doing(() => askExposure(state, ids)));
  const camera = small("Change camera…", doing(() => changeDetails(state)));
  return [
    ...({ wrong_camera: [camera], exposure_missing: [enter], exposure_implausible: [enter] }[code] ?? (frames.every((frame) => frame.refusal_code && frame.thumbnail) ? [smallLink("Draw region", "#region")] : [])),
    small(frames.length > 1 ? "Withdraw all" : "Withdraw", doing(() => withdraw(state, ids)), { quiet: true }),
  ];
}
