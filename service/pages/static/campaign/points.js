// A table of frame statistics, where the raw files are gone.

import { ask, readNumber } from "../ask.js";
import { send } from "../api.js";
import { toast, wrong } from "../dom.js";
import { counted } from "../format.js";

export async function addPoints(state, { file, name }) {
  const added = await ask({
    title: `Add the rows of ${name}`,
    fields: [
      { name: "white_level_dn", label: "White level [DN]", help: "Where the sensor clips: 255 of 8 bits." },
      { name: "black_level_dn", label: "Black level [DN]", help: "Empty if it is unknown.", required: false },
    ],
    submit: "Add",
    action: async (levels) => {
      const read = Object.entries(levels).map(([level, text]) => [level, readNumber(text)]);
      if (read.some(([, value]) => Number.isNaN(value))) throw wrong("A level is a number such as 4095.");
      const answer = await send("POST", `${state.path}/points?${new URLSearchParams(read)}`, { body: file, headers: { "Content-Type": "text/csv" } });
      return answer.json();
    },
  });
  if (!added) return;
  const { items, ignored_columns: ignored } = added;
  toast(`${counted(items.length, "row")} added.${ignored.length ? ` Not read: ${ignored.join(", ")}.` : ""}`);
  await state.touch();
}
