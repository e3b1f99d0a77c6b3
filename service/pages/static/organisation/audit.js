// Who did what, when and to what; chosen by these, and the state of the chain.

import { all, get, pathOf } from "../api.js";
import { small } from "../causes.js";
import { byId, empty, failed, fill, h, load, mark, may, table } from "../dom.js";
import { counted, inOrder, natural, number, words } from "../format.js";
import { sayValue } from "../campaign/parameters.js";

const BY_ITSELF = 3;

const checkChain = (place, { from = "/v1/audit/chain", before = 0, pieces = BY_ITSELF } = {}) => load(place, async () => {
  let [count, path, piece] = [before, from, null];
  for (let done = 0; path && done < pieces; done += 1) {
    piece = await get(path);
    count += piece.entries;
    path = piece.next && pathOf(piece.next);
  }
  return tell(place, piece, count, path);
}, (line) => line);

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

const PAGES = { cal: "/calibrations/", cam: "/cameras/", cmp: "/campaigns/", msr: "/measurements/", rig: "/rigs/", roa: "/roads/" };
const PROCESSES = ["service", "worker", "sweeper"];
const UNSAID = new Set(["id", "organisation_id", "sha256_sha256", "created_at", "reason"]);
const SHOWN = 100;

const form = byId("filter");
let entries = [];
let next = null;

const acts = new Map([...(form?.elements.action.options ?? [])].map((option) => [option.value, option.text]));

/** What is asked for, as it stands in the address too: a filtered trail can be sent on. */
function readFilter() {
  const chosen = Object.fromEntries([...new FormData(form)].filter(([, value]) => value));
  if (chosen.from) chosen.from += "T00:00:00Z";
  if (chosen.to) chosen.to = new Date(Date.parse(`${chosen.to}T00:00:00Z`) + 86400000).toISOString();
  return new URLSearchParams(chosen);
}

function show() {
  const asked = readFilter();
  for (const kind of ["csv", "jsonl"]) byId(kind).href = `/v1/audit/entries.${kind}?${asked}`;
  const kept = new URLSearchParams([...new FormData(form)].filter(([, value]) => value));
  history.replaceState(history.state, "", `${location.pathname}${kept.size ? `?${kept}` : ""}`);
  const id = form.elements.subject_id.value;
  byId("only").hidden = !id;
  fill(byId("only"), "Only one object. ", small("Show all", () => choose("")));
  return load(byId("entries"), () => get(`/v1/audit?limit=${SHOWN}&${asked}`), (page) => {
    entries = [];
    return add(page);
  });
}

function choose(id) {
  form.elements.subject_id.value = id;
  show();
}

function add(page) {
  entries.push(...page.items);
  next = page.next && pathOf(page.next);
  byId("older").hidden = !next;
  byId("counted").textContent = `${counted(entries.length, "entry").replace("entrys", "entries")}${next ? ", newest first" : ", all there are"}`;
  return entries.length ? draw() : empty("No entries", "No entry is of this person, act and time.");
}

function draw() {
  const columns = [
    { head: "Time, UTC", header: true, cell: (entry) => h("time", { datetime: entry.at, title: entry.at }, entry.at.slice(11, 19)) },
    { head: "Who", cell: (entry) => entry.actor_name ?? words(entry.actor) },
    { head: "What", cell: (entry) => acts.get(entry.action) ?? words(entry.action.replace(".", ": ")) },
    { head: "Object", cell: subject },
    { head: "Details", cell: details },
  ];
  const made = table(columns, entries, { caption: "Audit trail", stack: true, kind: "audit" });
  let day = "";
  made.querySelectorAll("tbody tr").forEach((row, place) => {
    const today = entries[place].at.slice(0, 10);
    if (today !== day) row.before(h("tr", { role: "row", class: "day" }, h("td", { role: "cell", colspan: columns.length }, today)));
    day = today;
  });
  return made;
}

function subject(entry) {
  const about = entry.about_id ?? entry.subject_id;
  const page = PAGES[about.slice(0, 3)];
  const name = entry.subject_name ?? words(entry.subject_type);
  return [page ? h("a", { href: page + about }, name) : name, " ", small(["only this", h("span", { class: "hidden" }, ` (${name})`)], () => choose(entry.subject_id), { quiet: true })];
}

function details(entry) {
  const names = Object.keys({ ...entry.before, ...entry.after }).filter((name) => !UNSAID.has(name) && !("rows" in entry.after)).sort(natural);
  const changed = names.map((name) => [h("dt", {}, words(name)), h("dd", {}, name in entry.before ? [sayValue(entry.before[name]), " → "] : "", sayValue(entry.after[name]))]);
  return [entry.after.reason, changed.length ? h("details", {}, h("summary", { class: "small" }, counted(names.length, "field")), h("dl", { class: "facts small" }, changed)) : null];
}

async function older() {
  try {
    fill(byId("entries"), add(await get(next)));
  } catch (error) {
    byId("entries").append(failed(error, older));
  }
}

async function begin() {
  const keys = inOrder(await all("/v1/keys"), (key) => key.name);
  form.elements.actor.append(...keys.map((key) => new Option(key.name, key.id)), ...PROCESSES.map((name) => new Option(`${name} (automatic)`, name)));
  for (const [name, value] of new URLSearchParams(location.search)) if (form.elements[name]) form.elements[name].value = value;
  form.addEventListener("change", show);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => setTimeout(() => choose("")));
  byId("older").addEventListener("click", older);
  await Promise.all([show(), checkChain(byId("chain"))]);
}

if (may("admin")) begin().catch((error) => fill(byId("entries"), failed(error, () => location.reload())));
