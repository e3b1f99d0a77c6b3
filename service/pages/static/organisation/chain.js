// Whether the chain of the audit trail holds: asked piece by piece, the first few by itself.

import { get, pathOf } from "../api.js";
import { small } from "../causes.js";
import { fill, h } from "../dom.js";
import { number } from "../format.js";
import { mark } from "../marks.js";
import { failed } from "../states.js";

const BY_ITSELF = 3;

/** Check the chain and tell the result in `place`; a long one is continued on demand. */
export async function checkChain(place, { from = "/v1/audit/chain", before = 0, pieces = BY_ITSELF } = {}) {
  place.setAttribute("aria-busy", "true");
  try {
    let [count, path, piece] = [before, from, null];
    for (let done = 0; path && done < pieces; done += 1) {
      piece = await get(path);
      count += piece.entries;
      path = piece.next && pathOf(piece.next);
    }
    fill(place, tell(place, piece, count, path));
  } catch (error) {
    fill(place, failed(error, () => checkChain(place)));
  } finally {
    place.removeAttribute("aria-busy");
  }
}

function tell(place, piece, count, path) {
  const entries = `${number(count, 9)} ${count === 1 ? "entry" : "entries"}`;
  const again = small("Check again", () => checkChain(place));
  if (piece.state === "broken") return line("bad", `The chain is broken at entry ${number(piece.broken_at, 9)}.`, `${piece.detail}. ${entries} before it are as they were. Tell the operator: “make audit” names the rows.`, again);
  if (path) return line("wait", `${entries} checked, none altered.`, "There are more.", small("Check the rest", () => checkChain(place, { from: path, before: count, pieces: Infinity })));
  const [seq, sha256] = piece.head.split(":");
  const head = h("span", { title: piece.head }, `Last entry: number ${number(Number(seq), 9)}, hash ${sha256.slice(0, 8)}…`);
  const skipped = Number(seq) > count ? h("p", { class: "small" }, "Entries are numbered over all organisations of this installation. The numbers that are missing here belong to others, or to changes that were not kept; in this chain no entry is missing.") : null;
  return line("good", `The chain is intact: ${entries}, none altered.`, [head, " ", h("details", {}, h("summary", { class: "small" }, "Note it elsewhere"), h("code", { class: "hash" }, piece.head), h("p", { class: "small" }, "Who can rewrite the database can recompute every hash. Only a note kept elsewhere shows that."), skipped)], again);
}

const line = (kind, title, text, button) => h("div", { class: `verdict-line ${kind}` }, mark(kind), h("div", {}, h("strong", {}, title), " ", h("span", {}, text)), button);
