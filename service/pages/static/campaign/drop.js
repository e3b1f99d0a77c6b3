// Chosen and dropped files, and every file below a dropped folder, with its path.

import { h } from "../dom.js";
import { inOrder } from "../groups.js";

/** Two hidden inputs, for files and for a folder: what is chosen is taken. */
export const choosers = (take, verb) =>
  [["Files", {}], ["Folder", { webkitdirectory: true }]].map(([what, more]) =>
    h("input", { type: "file", multiple: true, hidden: true, "aria-label": `${what} to ${verb}`, ...more, onchange: ({ target }) => {
      take([...target.files].map((file) => ({ file, name: file.webkitRelativePath || file.name })));
      target.value = "";
    } }),
  );

/** The whole window takes a drop; `zone` shows it. */
export function acceptDrops(zone, take) {
  let inside = 0;
  const over = (by) => zone.classList.toggle("over", (inside = Math.max(0, inside + by)) > 0);
  const holdsFiles = (event) => event.dataTransfer?.types.includes("Files");
  const on = (name, listener) => addEventListener(name, (event) => zone.isConnected && holdsFiles(event) && listener(event));
  on("dragenter", () => over(1));
  on("dragleave", () => over(-1));
  on("dragover", (event) => event.preventDefault());
  on("drop", async (event) => {
    event.preventDefault();
    over(-inside);
    take(await filesOf(event.dataTransfer));
  });
}

/** [{file, name}] of a drop; hidden files are left out, as cards carry half copies of frames under such names. */
async function filesOf(transfer) {
  // the entries must all be taken before the first wait: the browser takes the transfer back
  const entries = [...transfer.items].filter((item) => item.kind === "file").map((item) => item.webkitGetAsEntry?.());
  const plain = [...transfer.files];
  const found = [];
  for (const [index, entry] of entries.entries()) {
    if (entry) await walk(entry, "", found);
    else if (plain[index]) found.push({ file: plain[index], name: plain[index].name });
  }
  return inOrder(found, (each) => each.name);
}

async function walk(entry, above, found) {
  if (entry.name.startsWith(".")) return;
  const name = above ? `${above}/${entry.name}` : entry.name;
  if (entry.isFile) {
    found.push({ file: await new Promise((done, fail) => entry.file(done, fail)), name });
    return;
  }
  const reader = entry.createReader();
  for (;;) {
    // a hundred at a time, until there are none
    const some = await new Promise((done, fail) => reader.readEntries(done, fail));
    if (!some.length) return;
    for (const each of some) await walk(each, name, found);
  }
}
