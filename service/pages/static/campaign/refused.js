// Frames that a worker refused, or whose image has another size: one line per cause, with the buttons that mend it.

import { small } from "../causes.js";
import { may } from "../dom.js";
import { counted, typeset } from "../format.js";
import { groupBy } from "../groups.js";
import { act } from "../states.js";
import { changeDetails } from "./details.js";
import { askExposure, withdraw } from "./moves.js";

const MOST_NAMED = 5;
const isUnlike = ({ code, outcome }) => code === "format_differs" && outcome === "fail";

/** [{mark, title, where, actions}] of the frames that were refused, and of those whose image has another size, by its sentence. */
export function refusedCauses(state) {
  return [...groupBy(state.frames.filter((frame) => frame.refusal_code || isUnlike(frame)), (frame) => frame.refusal_code ?? frame.detail)].map(([code, some]) => {
    const named = some.slice(0, MOST_NAMED).map((frame) => frame.filename).join(", ");
    return { mark: "bad", title: `${counted(some.length, "frame")} ${isUnlike(some[0]) ? "of another image size" : "refused"}`, where: `${typeset(some[0].detail ?? "")} (${named}${some.length > MOST_NAMED ? ` and ${some.length - MOST_NAMED} more` : ""})`, actions: mendButtons(state, code, some) };
  });
}

/** What mends a refusal of these frames. */
export function mendButtons(state, code, frames) {
  if (!may("calibrate")) return [];
  const doing = (work) => (event) => act(event.target, work);
  const ids = frames.map((frame) => frame.id);
  const one = () => state.dispatchEvent(new CustomEvent("open-frame", { detail: ids[0] }));
  const enter = small("Enter exposure…", doing(() => (ids.length > 1 ? askExposure(state, ids) : one())));
  const camera = small("Change camera…", doing(() => changeDetails(state)));
  return [
    ...({ wrong_camera: [camera], exposure_missing: [enter], exposure_implausible: [enter] }[code] ?? []),
    small(frames.length > 1 ? "Withdraw all" : "Withdraw", doing(() => withdraw(state, ids)), { quiet: true }),
  ];
}
