// The keys of the organisation: what each may do, until when, and when it was last used.

import { all, get, post, send } from "../api.js";
import { about, ask, boxes } from "../ask.js";
import { small } from "../causes.js";
import { act, byId, empty, fill, h, load, mark, may, table, toast } from "../dom.js";
import { ago, counted, day, inOrder, tag, time } from "../format.js";
import { signing, statePerson } from "./person.js";

const BROWSERS = [["Edg", "Edge"], ["OPR", "Opera"], ["Firefox", "Firefox"], ["Chrom", "Chrome"], ["Safari", "Safari"]];
const SYSTEMS = [["Android", "Android"], ["iPhone", "iPhone"], ["iPad", "iPad"], ["Windows", "Windows"], ["Mac OS", "macOS"], ["CrOS", "ChromeOS"], ["Linux", "Linux"]];

const showSessions = () => load(byId("sessions"), () => all("/v1/sessions"), drawSessions);

function drawSessions(sessions) {
  const others = byId("end-others");
  others.hidden = !sessions.some((each) => !each.current);
  const order = (each) => (each.current ? Infinity : Date.parse(each.last_used_at ?? each.created_at));
  const columns = [
    { head: "Browser", header: true, cell: (each) => [h("span", { title: each.browser }, browserOf(each.browser ?? "")), each.current ? [" ", tag("this one", "good")] : null] },
    { head: "Key", cell: (each) => each.key_name },
    { head: "Signed in", cell: (each) => time(each.created_at) },
    { head: "Last seen", cell: (each) => (each.current ? "now" : h("time", { datetime: each.last_used_at ?? each.created_at, title: "to ten minutes" }, ago(each.last_used_at ?? each.created_at))) },
    { head: "", class: "number", cell: (each) => (each.current ? h("span", { class: "muted small" }, "sign out at the top") : endButton(each)) },
  ];
  return table(columns, sessions.sort((a, b) => order(b) - order(a)), { caption: "Sessions", stack: true });
}

const endButton = (each) => small("End", ({ target }) => act(target, () => end(`/v1/sessions/${each.id}`, "The session has ended.")), { class: "small-button danger", "aria-label": `End the session of ${each.key_name}, ${browserOf(each.browser ?? "")}` });

async function end(path, said) {
  const answer = await (await send("DELETE", path)).json();
  toast(answer.ended === undefined ? said : `${counted(answer.ended, "session")} ended.`);
  await showSessions();
}

function browserOf(text) {
  const find = (names) => names.find(([part]) => text.includes(part))?.[1];
  const [browser, system] = [find(BROWSERS), find(SYSTEMS)];
  return browser ? `${browser}${system ? ` on ${system}` : ""}` : text.slice(0, 40) || "Unnamed browser";
}

byId("end-others").addEventListener("click", ({ currentTarget: button }) => act(button, () => end("/v1/sessions")));

function tellSecret(text, said) {
  const secret = h("code", { tabindex: "0" }, text);
  const copy = small("Copy", async () => {
    getSelection().selectAllChildren(secret);
    // without https there is no clipboard: what is selected can be copied by hand
    await navigator.clipboard?.writeText(text);
    toast(navigator.clipboard ? "Copied." : "Selected: copy it with the keyboard.");
  });
  const box = h("div", { class: "note good" }, h("p", {}, h("strong", {}, said), " Copy it now; it is not shown again."), h("p", { class: "secret" }, secret, copy, small("I have saved it", () => fill(byId("made")), { quiet: true })));
  fill(byId("made"), box);
  copy.focus();
}

const DAY_MS = 86400000;
const IDLE_DAYS = 180;
const SOON_DAYS = 30;
const SCOPES = Object.fromEntries(JSON.parse(byId("main").dataset.scopes));

let shown = "active";

const own = get("/v1/keys/own");
const show = () => load(byId("keys"), async () => [may("admin") ? await all("/v1/keys") : [await own], (await own).id], draw);

function draw([keys, ownId]) {
  const [active, ended] = [keys.filter((key) => !isEnded(key)), keys.filter(isEnded)];
  const bar = byId("shown");
  bar.hidden = !ended.length;
  fill(bar, ...[["active", "Active", active], ["ended", "Ended", ended]].map(([name, label, some]) => h("button", { type: "button", "aria-pressed": String(shown === name), onclick: () => ((shown = name), show()) }, label, " ", h("small", {}, String(some.length)))));
  const listed = inOrder(shown === "ended" ? ended : active, (key) => key.name);
  if (!listed.length) return empty("No keys");
  const columns = [
    { head: "Key", header: true, cell: (key) => [mark(judge(key)), " ", key.name, h("span", { class: "sub" }, key.id === ownId ? "your key" : `made ${day(key.created_at)}`)] },
    { head: "Person", cell: (key) => (key.person ? [key.person, h("span", { class: "sub" }, key.role)] : h("span", { class: "muted" }, "not stated")) },
    { head: "Permissions", cell: (key) => h("span", { class: "chips" }, Object.entries(SCOPES).filter(([scope]) => key.scopes.includes(scope)).map(([, word]) => h("span", { class: "chip" }, word))) },
    { head: "Expires", cell: expiry },
    { head: "Last used", cell: (key) => (key.last_used_at ? h("time", { datetime: key.last_used_at, title: `${key.last_used_at}, to ten minutes` }, ago(key.last_used_at)) : h("span", { class: "muted" }, "never used")) },
  ];
  if (shown === "ended") columns.push({ head: "Revoked", cell: (key) => time(key.revoked_at) });
  else if (may("admin")) columns.push({ head: "", class: "number", cell: (key) => [small("Person…", () => name(key), { "aria-label": `Person of ${key.name}` }), key.id === ownId ? "" : [" ", small("Revoke…", () => revoke(key), { class: "small-button danger", "aria-label": `Revoke ${key.name}` })]] });
  const notes = [
    listed.some(isIdle) ? h("p", { class: "small muted" }, mark("warn"), ` Not used for ${IDLE_DAYS} days: revoke it if it is no longer needed.`) : null,
    may("admin") ? null : h("p", { class: "small muted" }, "To get another key or permission, ask an administrator of your organisation."),
  ];
  return [table(columns, listed, { caption: shown === "ended" ? "Ended keys" : "Keys", stack: true }), notes];
}

const daysSince = (instant) => (Date.now() - new Date(instant)) / DAY_MS;
const isEnded = (key) => Boolean(key.revoked_at) || (key.expires_at && daysSince(key.expires_at) >= 0);
const isIdle = (key) => !isEnded(key) && daysSince(key.last_used_at ?? key.created_at) > IDLE_DAYS;
const judge = (key) => (isEnded(key) ? "out" : isIdle(key) ? "warn" : key.last_used_at ? "good" : "wait");

function expiry(key) {
  if (!key.expires_at) return h("span", { class: "muted" }, "never");
  const left = -daysSince(key.expires_at);
  const said = h("time", { datetime: key.expires_at, title: key.expires_at, class: "nowrap" }, day(key.expires_at));
  return !isEnded(key) && left < SOON_DAYS ? [said, " ", tag(ago(key.expires_at), "warn")] : said;
}

async function make() {
  const inAYear = new Date(Date.now() + 365 * DAY_MS).toISOString().slice(0, 10);
  const box = ([scope, word]) => h("label", { class: "check" }, h("input", { type: "checkbox", name: `scope-${scope}`, checked: scope === "read" }), word);
  const key = await ask({
    title: "New key",
    fields: [
      { name: "name", label: "Name", of: "NewKey", maxlength: 200 },
      ...signing(),
      { name: "expires_on", label: "Last day (UTC)", of: ["NewKey", "expires_at"], type: "date", value: inAYear, required: false, hint: "Empty: valid until it is revoked." },
    ],
    after: boxes("Permissions", about("NewKey", "scopes"), Object.entries(SCOPES).map(box)),
    submit: "Make key",
    action: ({ name, person, role, expires_on, ...ticked }) => {
      const scopes = Object.keys(SCOPES).filter((scope) => ticked[`scope-${scope}`]);
      return post("/v1/keys", { name, scopes, ...(person ? { person } : {}), ...(role ? { role } : {}), ...(expires_on ? { expires_at: `${expires_on}T23:59:59Z` } : {}) });
    },
  });
  if (!key) return;
  tellSecret(key.secret, `Key “${key.name}” is made.`);
  shown = "active";
  await show();
}

async function name(key) {
  if (await statePerson(key)) await show();
}

async function revoke(key) {
  const ended = await ask({
    title: `Revoke “${key.name}”?`,
    body: h("p", {}, "It opens nothing from now on, and browsers signed in with it are signed out. This cannot be undone."),
    submit: "Revoke key",
    danger: true,
    action: async () => (await send("DELETE", `/v1/keys/${key.id}`)).json(),
  });
  if (!ended) return;
  toast(`“${key.name}” is revoked.`);
  await Promise.all([show(), showSessions()]);
}

byId("new-key").hidden = !may("admin");
byId("new-key").addEventListener("click", make);
show();
showSessions();
