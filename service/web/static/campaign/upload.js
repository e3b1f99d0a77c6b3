// The upload area: role, progress and verdict of each file.

import { fill, h, toast } from "../dom.js";
import { bytes, counted, span, tag } from "../format.js";
import { roleLabel, roleOptions } from "../methods.js";
import { act } from "../states.js";
import { filesOf } from "./drop.js";
import { select } from "./forms.js";
import { patternsPart } from "./patterns.js";
import { UploadQueue } from "./queue.js";
import { judge } from "./rules.js";
import { virtualTable } from "./virtual.js";

const ROW_PX = 48;
const OPEN = ["hashing", "asking", "ready", "failed", "lost"];

export function uploadSection(state) {
  const queue = new UploadQueue(state);
  const patterns = patternsPart(state, () => judgeAgain(queue, judgeName));
  const judgeName = (name) => judge(name, patterns.rules()) ?? { role: state.method.roles[0].name };
  const take = (files) => {
    const count = queue.add(files, judgeName);
    if (!count && files.length) toast("These files are already in the list.");
  };
  const list = itemTable(state, queue);
  const head = h("div", { class: "upload-head" });
  const panel = h("div", { class: "upload-panel card", hidden: true }, head, patterns.element, list.element);
  let waiting = false;
  const draw = () => {
    // a button that is replaced while it is pressed gets no click
    if (head.matches(":active")) return void requestAnimationFrame(draw);
    waiting = false;
    panel.hidden = queue.items.length === 0;
    if (panel.hidden) return;
    fillKept(head, summary(state, queue));
    patterns.element.hidden = !queue.items.some((item) => OPEN.includes(item.state));
    list.show([...queue.items]);
  };
  const soon = () => {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  };
  queue.addEventListener("changed", soon);
  queue.addEventListener("sent", debounce(() => state.touch(), 800));
  state.on("frames", soon);
  queue.resume().then((count) => count && toast(`Resuming ${counted(count, "file")} of an earlier session.`));
  addEventListener("beforeunload", (event) => {
    if (queue.items.some((item) => item.state === "sending" && !queue.journal.kept)) event.preventDefault();
  });
  return [dropZone(take), panel];
}

function dropZone(take) {
  const choose = (attributes) => h("input", { type: "file", multiple: true, hidden: true, ...attributes, onchange: (event) => {
    take([...event.target.files].map((file) => ({ file, name: file.webkitRelativePath || file.name })));
    event.target.value = "";
  } });
  const files = choose({ "aria-label": "Files to send" });
  const folder = choose({ "aria-label": "Folder to send", webkitdirectory: true });
  const zone = h(
    "div",
    { class: "drop" },
    h("p", {}, h("strong", {}, "Drop the camera’s files or a folder here")),
    h("p", { class: "muted small" }, "Files are compared by content first; files that the service already has are not sent again. A lost connection or a reload loses nothing."),
    h("p", { class: "actions" }, h("button", { type: "button", onclick: () => files.click() }, "Choose files"), h("button", { type: "button", class: "quiet", onclick: () => folder.click() }, "Choose a folder"), files, folder),
  );
  let inside = 0;
  const over = (by) => zone.classList.toggle("over", (inside += by) > 0);
  zone.addEventListener("dragenter", () => over(1));
  zone.addEventListener("dragleave", () => over(-1));
  zone.addEventListener("dragover", (event) => event.preventDefault());
  zone.addEventListener("drop", async (event) => {
    event.preventDefault();
    over(-inside);
    take(await filesOf(event.dataTransfer));
  });
  return zone;
}

function summary(state, queue) {
  const of = (...states) => queue.items.filter((item) => states.includes(item.state));
  const [ready, there, sent, lost, failed] = [of("ready"), of("there"), of("sent"), of("lost"), of("failed")];
  const moving = of("waiting", "sending", "retrying");
  const all = [...moving, ...sent];
  const total = all.reduce((sum, item) => sum + item.size, 0);
  const done = all.reduce((sum, item) => sum + Math.min(item.sent, item.size), 0);
  const title = moving.length
    ? `${sent.length} of ${all.length} sent`
    : ready.length ? `${ready.length} ready to send` : sent.length ? outcomeOf(state, sent) : of("hashing", "asking").length ? "Comparing with the service" : `${there.length} already there`;
  const rest = moving.length ? [bytes(total - done), "to go", queue.rate > 0 ? `at ${bytes(queue.rate)}/s, ${span((total - done) / queue.rate)} left` : ""].join(" ") : "";
  const notes = [
    of("hashing", "asking").length && `${of("hashing", "asking").length} being compared`,
    there.length && `${there.length} already there, not sent`,
    of("retrying").length && `${of("retrying").length} waiting for the connection`,
    failed.length && `${failed.length} not accepted`,
    lost.length && `${lost.length} of an earlier session: select the files again to resume`,
  ].filter(Boolean);
  return [
    h("div", { class: "section-head" }, h("h3", { role: "status" }, title), h("p", {}, rest)),
    moving.length ? h("progress", { max: total || 1, value: done, "aria-label": "Sent" }) : null,
    notes.length ? h("p", { class: "muted small" }, notes.join(" · ")) : null,
    h(
      "p",
      { class: "actions" },
      ready.length || failed.length ? h("button", { type: "button", class: "primary", "data-keep": "send", onclick: (event) => act(event.target, () => queue.send()) }, ready.length ? `Send ${counted(ready.length, "file")}` : "Try again") : null,
      of("retrying").length ? h("button", { type: "button", "data-keep": "now", onclick: () => queue.retryNow() }, "Try now") : null,
      moving.length ? h("button", { type: "button", "data-keep": "stop", onclick: () => queue.drop(of("waiting", "sending", "retrying")) }, "Stop") : h("button", { type: "button", class: "quiet", "data-keep": "clear", onclick: () => queue.drop([...queue.items]) }, "Clear list"),
    ),
  ];
}

/** "38 of 38 received, 36 pass, 2 warn" */
function outcomeOf(state, sent) {
  const counts = {};
  for (const item of sent) {
    const outcome = state.verdicts.get(item.frameId)?.outcome ?? "pending";
    counts[outcome] = (counts[outcome] ?? 0) + 1;
  }
  const words = { pass: "pass", warn: "warn", fail: "fail", pending: "being read" };
  return [`${sent.length} of ${sent.length} received`, ...Object.keys(words).filter((name) => counts[name]).map((name) => `${counts[name]} ${words[name]}`)].join(", ");
}

function itemTable(state, queue) {
  const editable = (item) => ["hashing", "asking", "ready", "failed"].includes(item.state);
  const edit = (item, values) => {
    Object.assign(item, values, { edited: true });
    queue.changed();
  };
  return virtualTable({
    columns: [{ head: "File", class: "name" }, { head: "Progress", class: "how-far" }, { head: "Role", class: "role" }, { head: "Scene", class: "scene" }, { head: "Size", class: "number size" }],
    rowHeight: ROW_PX,
    caption: "Upload list",
    keyOf: (item) => item.key,
    markOf: (item) => [item.state, item.role, item.edited ? "" : item.scene, item.error, editable(item), item.state === "sending" ? Math.floor((100 * item.sent) / item.size) : "", state.verdicts.get(item.frameId)?.outcome].join("|"),
    draw: (item) => [
      h("span", { title: item.name }, item.name),
      progressOf(state, item),
      editable(item) ? select(roleOptions(state.method), { "aria-label": `Role of ${item.name}`, onchange: (event) => edit(item, { role: event.target.value }) }, item.role) : roleLabel(item.role),
      editable(item) ? h("input", { "aria-label": `Scene of ${item.name}`, value: item.scene ?? "", list: "scenes-known", onchange: (event) => edit(item, { scene: event.target.value.trim() || undefined }) }) : (item.scene ?? "–"),
      bytes(item.size),
    ],
  });
}

function progressOf(state, item) {
  const verdict = state.verdicts.get(item.frameId);
  switch (item.state) {
    case "hashing":
    case "asking":
      return h("span", { class: "muted" }, "Comparing…");
    case "ready":
      return tag("ready");
    case "there":
      return tag("already there", "good");
    case "waiting":
      return h("span", { class: "muted" }, "Waiting");
    case "sending":
      return [h("progress", { max: item.size || 1, value: item.sent, "aria-label": `Sent of ${item.name}` }), h("span", { class: "sub" }, `${Math.floor((100 * item.sent) / (item.size || 1))} %`)];
    case "retrying":
      return [tag("waiting for connection", "warn")];
    case "sent":
      return verdict ? tag(verdict.outcome) : tag("being read", "live");
    case "lost":
      return tag("select again", "warn");
    default:
      return [tag("not accepted", "bad"), h("span", { class: "why", title: item.error }, item.error)];
  }
}

function judgeAgain(queue, judgeName) {
  for (const item of queue.items) if (!item.edited && OPEN.includes(item.state) && item.state !== "lost") Object.assign(item, { scene: undefined }, judgeName(item.name));
  queue.changed();
}

/** As fill, but a button that has the focus keeps it. */
function fillKept(element, children) {
  const kept = element.contains(document.activeElement) ? document.activeElement.dataset.keep : undefined;
  const busy = element.querySelector("[aria-busy=true]");
  if (busy) return;
  fill(element, children);
  if (kept) element.querySelector(`[data-keep="${kept}"]`)?.focus();
}

function debounce(work, ms) {
  let timer;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(work, ms);
  };
}
