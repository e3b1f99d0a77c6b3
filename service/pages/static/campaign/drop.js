// Dropped files, and every file below a dropped folder, with its path.

import { inOrder } from "../groups.js";

/** [{file, name}] of a drop; hidden files are left out, as cards carry half copies of frames under such names. */
export async function filesOf(transfer) {
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
