// Readings typed and pasted in the heads of the grid's rows.

import { act } from "../states.js";

const isRead = (line) => line.first && line.row.kind === "role" && line.row.value !== null;

/** `lines()` of the grid, `bring(line)` draws one that is out of sight, `leave(line)` goes to its first frame. */
export function typing({ body, book, lines, bring, leave }) {
  const scenesRead = () => lines().filter(isRead).map((line) => line.row.value);
  const fieldOf = (scene) => body.querySelector(`[data-reading="${CSS.escape(scene ?? "")}"]`);

  /** Cells of a spreadsheet go down the rows; one value is pasted as it is. */
  body.addEventListener("paste", (event) => {
    const text = event.clipboardData.getData("text/plain");
    const { reading } = event.target.dataset;
    if (reading === undefined || !/[\n\r\t]./.test(text.trimEnd())) return;
    event.preventDefault();
    act(event.target, () => book.pasted(text, scenesRead().slice(scenesRead().indexOf(reading))));
  });

  /** Enter records a value and goes to the next scene without one. */
  function press(event) {
    const scene = event.target.dataset.reading;
    if (event.key === "Escape") leave(lines().find((line) => line.row.value === scene));
    if (event.key !== "Enter") return;
    event.preventDefault();
    const known = (name) => book.readings.some((each) => each.scene === name && !each.withdrawn_at);
    const scenes = scenesRead();
    const following = [...scenes.slice(scenes.indexOf(scene) + 1), ...scenes].find((name) => name !== scene && !known(name));
    event.target.blur();
    if (following === undefined) return;
    if (!fieldOf(following)) bring(lines().find((line) => line.row.value === following));
    fieldOf(following)?.focus();
  }

  return { press, go: (line) => fieldOf(line?.row.value)?.focus() };
}
