// Frames that are dragged to another row; the twins of dragging are the key M and the selection.

import { may } from "../dom.js";
import { act } from "../states.js";
import { moveTo } from "./moves.js";

const KIND = "text/x-stilb-frames";

/** `pick(id)` answers the frames that go with one, `rowAt(element)` the row of the grid that it is in. */
export function dragging(body, { state, pick, rowAt }) {
  const lifts = (row) => row?.kind === "role";
  const clear = () => body.querySelectorAll(".over").forEach((each) => each.classList.remove("over"));
  body.addEventListener("dragstart", (event) => {
    const { id } = event.target.closest?.(".cell")?.dataset ?? {};
    if (!id || !may("calibrate")) return event.preventDefault();
    event.dataTransfer.setData(KIND, JSON.stringify(pick(id)));
    event.dataTransfer.effectAllowed = "move";
    return null;
  });
  body.addEventListener("dragover", (event) => {
    if (!event.dataTransfer.types.includes(KIND)) return;
    clear();
    if (!lifts(rowAt(event.target))) return;
    event.preventDefault();
    event.target.closest("tr").classList.add("over");
  });
  body.addEventListener("dragend", clear);
  body.addEventListener("drop", (event) => {
    clear();
    const row = rowAt(event.target);
    const ids = JSON.parse(event.dataTransfer.getData(KIND) || "[]");
    if (!ids.length || !lifts(row)) return;
    event.preventDefault();
    act(body.closest(".grid"), () => moveTo(state, ids, row));
  });
}
