// What was done last can be undone: by the button that passes by, or with Z.

import { toast } from "./dom.js";

const steps = [];

/** Keep the way back of something that the page shows where it was done. */
export const remember = (undo) => steps.push(undo);

/** Say that something was done, with the way back. */
export function done(text, undo) {
  remember(undo);
  toast(text, { label: "Undo", key: "Z", action: () => take(undo) });
}

/** Undo what was done last. */
export const undoLast = () => steps.length && take(steps.at(-1));

export async function take(undo) {
  const at = steps.indexOf(undo);
  if (at < 0) return;
  steps.splice(at, 1);
  try {
    await undo();
    toast("Undone.");
  } catch (error) {
    toast(`Not undone. ${error.message}`);
  }
}
