// The region that applies to a frame: its own (drawn, or found on a panel), else the campaign's.

import { get } from "../api.js";
import { counted } from "../format.js";

const FOUND = { code: "found by the code of", reflect_area: "as the camera stated it for", other_band: "taken from another band, of" };

/** A frame's own region in words; "" where the campaign's holds. */
export function originOf(frame) {
  if (!frame.roi_id) return "";
  if (frame.roi_origin !== "found") return "drawn for this frame";
  return `${FOUND[frame.roi_found_by]} ${frame.panel_serial ? `panel ${frame.panel_serial}` : "the panel"}`;
}

/** What to do about it, on the frame that is shown; "" where the campaign's region holds. */
export function adviceOn(frame, state) {
  if (startsEmpty(frame, state)) return "A field frame starts without a region: the campaign’s lies where the calibration was made. Draw what this frame shows, and set it only for this frame.";
  if (!frame.roi_id) return "";
  const said = frame.roi_origin === "found" ? `This frame’s region is shown, ${originOf(frame)}.` : "This frame’s own region is shown.";
  return `${said} To replace it, draw a region and set it only for this frame. A region set for the campaign does not replace it.`;
}

/** How many frames have a region of their own: {own, found, said}; `said` is "" where none has. */
export function countOwn(frames) {
  const own = frames.filter((frame) => frame.roi_id);
  const found = own.filter((frame) => frame.roi_origin === "found").length;
  const said = [found && `${counted(found, "frame")} found on the panel`, own.length - found && `${counted(own.length - found, "frame")} drawn individually`].filter(Boolean).join(", ");
  return { own: own.length, found, said };
}

/** Whether a frame shows another place than the campaign's region is meant for; a night's region is meant for its frames. */
export const startsEmpty = (frame, state) => !state.method.measures && frame.role === "field" && !frame.roi_id;

const known = new Map();

/** The region that holds for a frame, as the API has it; null where there is none yet. */
export function holdingFor(state, frame) {
  if (!frame.roi_id || frame.roi_id === state.roi?.id) return state.roi;
  if (!known.has(frame.roi_id)) {
    const asked = get(`/v1/frames/${frame.id}/roi`);
    known.set(frame.roi_id, asked);
    asked.catch(() => known.delete(frame.roi_id));
  }
  return known.get(frame.roi_id);
}
