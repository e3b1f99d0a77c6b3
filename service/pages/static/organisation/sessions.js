// The browsers that are signed in, and how they are signed out.

import { all, send } from "../api.js";
import { small } from "../causes.js";
import { byId, h, table, toast } from "../dom.js";
import { ago, counted, tag, time } from "../format.js";
import { act, load } from "../states.js";

const BROWSERS = [["Edg", "Edge"], ["OPR", "Opera"], ["Firefox", "Firefox"], ["Chrom", "Chrome"], ["Safari", "Safari"]];
const SYSTEMS = [["Android", "Android"], ["iPhone", "iPhone"], ["iPad", "iPad"], ["Windows", "Windows"], ["Mac OS", "macOS"], ["CrOS", "ChromeOS"], ["Linux", "Linux"]];

export const showSessions = () => load(byId("sessions"), () => all("/v1/sessions"), draw);

function draw(sessions) {
  const others = byId("end-others");
  others.hidden = !sessions.some((each) => !each.current);
  const order = (each) => (each.current ? Infinity : Date.parse(each.last_used_at ?? each.created_at));
  return table(
    [
      { head: "Browser", header: true, cell: (each) => [h("span", { title: each.browser }, browserOf(each.browser ?? "")), each.current ? [" ", tag("this one", "good")] : null] },
      { head: "Key", cell: (each) => each.key_name },
      { head: "Signed in", cell: (each) => time(each.created_at) },
      { head: "Last seen", cell: (each) => (each.current ? "now" : h("time", { datetime: each.last_used_at ?? each.created_at, title: "to ten minutes" }, ago(each.last_used_at ?? each.created_at))) },
      { head: "", class: "number", cell: (each) => (each.current ? h("span", { class: "muted small" }, "sign out at the top") : endButton(each)) },
    ],
    sessions.sort((a, b) => order(b) - order(a)),
    { caption: "Sessions", stack: true },
  );
}

const endButton = (each) => {
  const button = small("End", () => act(button, () => end(`/v1/sessions/${each.id}`, "The session has ended.")), { class: "small-button danger", "aria-label": `End the session of ${each.key_name}, ${browserOf(each.browser ?? "")}` });
  return button;
};

async function end(path, said) {
  const answer = await (await send("DELETE", path)).json();
  toast(answer.ended === undefined ? said : `${counted(answer.ended, "session")} ended.`);
  await showSessions();
}

/** What a browser calls itself, in two words: Firefox on Linux. */
function browserOf(text) {
  const find = (names) => names.find(([part]) => text.includes(part))?.[1];
  const [browser, system] = [find(BROWSERS), find(SYSTEMS)];
  return browser ? `${browser}${system ? ` on ${system}` : ""}` : text.slice(0, 40) || "Unnamed browser";
}

byId("end-others").addEventListener("click", ({ currentTarget: button }) => act(button, () => end("/v1/sessions")));
