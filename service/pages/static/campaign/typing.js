// Readings typed and pasted in the heads of the grid's rows.

const isRead = (line) => line.first && line.row.kind === "role" && line.row.value !== null;

/** `lines()` of the grid, `bring(line)` draws one that is out of sight, `leave(line)` goes to its first frame. */
export function typing({ body, book, lines, bring, leave }) {
  const scenesRead = () => lines().filter(isRead).map((line) => line.row.value);
  const fieldOf = (scene) => body.querySelector(`[data-reading="${CSS.escape(scene ?? "")}"]`);
  const isDue = (scene) => !book.of(scene).some((each) => !each.withdrawn_at) && !fieldOf(scene)?.value;

  function go(scene) {
    const line = lines().find((each) => isRead(each) && each.row.value === scene);
    if (!line) return;
    if (!fieldOf(scene)) bring(line);
    fieldOf(scene)?.focus();
  }

  async function paste(given) {
    (await import("./paste.js")).openPaste(book, scenesRead(), given);
  }

  /** Cells of a spreadsheet go down the rows; one value is pasted as it is. */
  body.addEventListener("paste", (event) => {
    const text = event.clipboardData.getData("text/plain");
    const { reading } = event.target.dataset;
    if (reading === undefined || !/[\n\r\t]./.test(text.trimEnd())) return;
    event.preventDefault();
    paste({ text, from: reading });
  });

  /** Enter records a value and goes to the next scene without one. */
  function press(event) {
    const scene = event.target.dataset.reading;
    if (event.key === "Escape") leave(lines().find((line) => line.row.value === scene));
    if (event.key !== "Enter") return;
    event.preventDefault();
    const scenes = scenesRead();
    const following = [...scenes.slice(scenes.indexOf(scene) + 1), ...scenes].find((name) => name !== scene && isDue(name));
    event.target.blur();
    if (following !== undefined) go(following);
  }

  return {
    press,
    go: (line) => go(line?.row.value),
    /** The first scene without a reading in the order of the rows, whatever of them is drawn; else the first one. */
    first: () => go(scenesRead().find(isDue) ?? scenesRead()[0]),
    paste: () => paste({}),
  };
}
