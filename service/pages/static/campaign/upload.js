// The upload area: what stands in the way, what is to be sent, and the progress of all. Each frame is listed in the grid alone.

import { get, patch, post } from "../api.js";
import { readCard } from "../card/headers.js";
import { differs, findAsides, nameOf, placeIn, splitSkipped } from "../card/propose.js";
import { sayCheck } from "../card/view.js";
import { causeList, small } from "../causes.js";
import { act, byId, fill, h, isPressed, load, mark, may, toast } from "../dom.js";
import { bytes, counted, groupBy, span } from "../format.js";
import { roleLabel, titleOf } from "../methods.js";
import { goOn, takeFiles, takeHanded } from "./drop.js";
import { OPEN, UploadQueue } from "./queue.js";
import { mendButtons } from "./moves.js";

const MOST_NAMED = 5;

export function uploadSection(state) {
  const queue = new UploadQueue(state);
  const trouble = h("div");
  const given = new Map();
  let sorted = Promise.resolve();
  const take = (files) => (sorted = sorted.then(() => load(trouble, () => sortOut(files), (lines) => lines)));

  /** Put into the queue what belongs to the campaign; answers what is to be said of the other files. */
  async function sortOut(all) {
    const tables = state.method.reference === "meter" ? all.filter(({ name }) => /\.csv$/i.test(name)) : [];
    for (const table of tables) await (await import("./points.js")).addPoints(state, table);
    const files = all.filter((each) => !tables.includes(each));
    if (!files.length) return null;
    const campaign = state.campaign ?? (await get(state.path));
    const camera = await get(`/v1/cameras/${campaign.camera_id}`);
    const rows = await readCard(files);
    const { twins, videos } = splitSkipped(rows);
    const open = await Promise.all(rows.filter((row) => !twins.includes(row) && !videos.includes(row)).map(unpacked));
    const closed = open.filter((row) => !row.file);
    const wanted = await placeIn(campaign, open.filter((row) => row.file));
    const others = wanted.filter((row) => row.header && differs(row.header, camera));
    const own = wanted.filter((row) => !others.includes(row));
    const asides = findAsides(own.filter((row) => row.header), own).filter(({ frames }) => frames.every((row) => row.header));
    for (const { file, name } of files) given.set(name, file.size);
    const count = queue.add(own.filter((row) => !asides.some(({ frames }) => frames.includes(row))));
    if (!count && !others.length && !asides.length && wanted.length) toast("These files are already in the list.");
    else if (twins.length + videos.length) toast(`Skipped: ${[twins.length && counted(twins.length, "JPEG twin"), videos.length && counted(videos.length, "video")].filter(Boolean).join(", ")}.`);
    const change = async (body) => {
      await patch(state.path, { camera_id: (await post("/v1/cameras", body)).id });
      fill(trouble);
      queue.add(others);
      await state.touch();
    };
    return [
      asides.length ? causeList(asides.map((check) => leftOut(check, () => queue.add(check.frames)))) : null,
      closed.length ? notOpened(closed) : null,
      others.length ? otherCamera(campaign, camera, others, wanted.length, change) : null,
    ];
  }

  const zone = byId("drop");
  takeFiles(zone, "send", take);
  const panel = h("div", { class: "upload-panel card", hidden: true });
  let [waiting, isSending] = [false, false];
  const tellSending = async () => {
    // the campaign knows of the last file before anything is called missing
    if (!isSending) await state.touch();
    state.sending = isSending;
    state.tell("sending");
  };
  const draw = () => {
    // a button that is at work ends it first
    if (isPressed(panel) || panel.querySelector("[aria-busy=true]")) return void requestAnimationFrame(draw);
    waiting = false;
    panel.hidden = queue.items.length === 0;
    zone.classList.toggle("slim", !panel.hidden || state.frames.length > 0);
    const sending = queue.items.some((item) => item.armed && OPEN.includes(item.state));
    if (sending !== isSending) tellSending((isSending = sending));
    if (!panel.hidden) fill(panel, summary(state, queue, given));
  };
  const soon = () => {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  };
  queue.addEventListener("changed", soon);
  state.on("frames", () => {
    refuseLike(state, queue);
    soon();
  });
  const handed = takeHanded();
  if (handed) {
    queue.add(handed);
    queue.send();
  }
  queue.resume().then((count) => count && toast(`Resuming ${counted(count, "file")} of an earlier session.`));
  addEventListener("beforeunload", (event) => {
    if (queue.items.some((item) => item.armed && OPEN.includes(item.state)) && !queue.journal.kept) event.preventDefault();
  });
  soon();
  return [trouble, panel];
}

/** What a worker refuses, it refuses after the frame was sent: the rest is stopped then too. */
function refuseLike(state, queue) {
  for (const item of queue.items) {
    const { refusal_code: code, detail } = (item.state === "sent" && state.byId.get(item.frameId)) || {};
    if (code) queue.refuse(item, { code, message: detail });
  }
}

async function unpacked(row) {
  try {
    return { ...row, file: row.file ?? (await row.open?.()) };
  } catch (error) {
    return { ...row, fault: error.message };
  }
}

/** Of another day, place or aim, or cut short: one line, and a button that takes them in after all. */
function leftOut(check, include) {
  const [title, where] = sayCheck(check);
  return { mark: check.mark, title, where, actions: [small(check.code === "cut" ? "Send anyway" : "Include", (event) => (include(), event.target.closest("li").remove()), { quiet: check.code === "cut" })] };
}

const notOpened = (rows) =>
  h("div", { class: "failed", role: "alert" }, h("p", { class: "failed-title" }, `${counted(rows.length, "file")} cannot be read and ${rows.length === 1 ? "is" : "are"} not in the list`), rows.slice(0, MOST_NAMED).map((row) => h("p", {}, `${row.name}: ${row.fault}`)), rows.length > MOST_NAMED ? h("p", {}, `And ${rows.length - MOST_NAMED} more.`) : null);

/** Frames of another camera are seen here, before they are sent; `change` makes the campaign that camera's. */
function otherCamera(campaign, camera, others, count, change) {
  const bodies = groupBy(others, ({ header: { make, model, serial } }) => JSON.stringify([make, model, serial]));
  const { make, model, serial, lens } = others[0].header;
  const one = bodies.size === 1 && make && model && serial && others.length === count && may("calibrate");
  const said = [...new Set(others.map((row) => nameOf(row.header)))].slice(0, 3).join(", ");
  return h("div", { class: "verdict-words bad", role: "alert" },
    mark("bad"),
    h("h3", {}, "These frames are from another camera"),
    h("p", {}, `${titleOf(campaign)} is for `, h("strong", {}, nameOf(camera)), `. ${others.length === count ? (count === 1 ? "The file says" : `All ${count} files say`) : `${others.length} of ${count} files say`} `, h("strong", {}, said), ". They have not been sent."),
    h("p", { class: "actions" }, one ? h("button", { type: "button", class: "primary small-button", onclick: (event) => act(event.target, () => change({ make, model, serial, lens })) }, `Change the campaign to ${nameOf(others[0].header)}`) : null, h("button", { type: "button", class: `${one ? "" : "primary "}small-button`, onclick: () => goOn("/", others.map(({ file, name }) => ({ file, name }))) }, "New campaign"), small("Leave them out", (event) => event.target.closest(".verdict-words").remove())),
  );
}

function summary(state, queue, given) {
  const of = (...states) => queue.items.filter((item) => states.includes(item.state));
  const [there, sent, lost, failed, retrying] = [of("there"), of("sent"), of("lost"), of("failed"), of("retrying")];
  const moving = queue.items.filter((item) => item.armed && OPEN.includes(item.state));
  const open = queue.items.filter((item) => !item.armed && ["hashing", "asking", "ready"].includes(item.state));
  const all = [...moving, ...sent];
  const total = all.reduce((sum, item) => sum + item.size, 0);
  const done = all.reduce((sum, item) => sum + Math.min(item.sent, item.size), 0);
  const title = moving.length ? `Sending ${sent.length} of ${all.length}` : open.length ? `${open.length} to send` : sent.length ? outcomeOf(state, sent) : `${there.length} already there`;
  const rest = moving.length ? [`${bytes(done)} of ${bytes(total)}`, queue.rate > 0 ? `${bytes(queue.rate)}/s` : "", queue.rate > 0 ? `${span((total - done) / queue.rate)} left` : ""].filter(Boolean).join(" · ") : open.length ? bytes(open.reduce((sum, item) => sum + item.size, 0)) : "";
  const comparing = of("hashing", "asking").length;
  const notes = [
    // a line while files wait, whatever it says: what is below it stays where it is pressed
    comparing ? `${comparing} being compared` : open.length && "all compared",
    there.length && `${there.length} already there, not sent`,
    retrying.length && `${retrying.length} waiting for the connection`,
    lost.length && `${lost.length} of an earlier session: select the files again to resume`,
  ].filter(Boolean);
  const unmeasured = !moving.length && sent.some((item) => standingOf(state, item) === WAITS.no_region);
  const button = (text, keep, onclick, more = {}) => h("button", { type: "button", "data-keep": keep, onclick, ...more }, text);
  return [
    h("div", { class: "section-head" }, h("h3", {}, h("span", { role: "status" }, title)), h("p", {}, rest)),
    moving.length ? h("progress", { max: total || 1, value: done, "aria-label": "Sent" }) : null,
    retrying.length && queue.lostSince ? h("p", { class: "note warn" }, h("strong", {}, `No connection since ${new Date(queue.lostSince).toTimeString().slice(0, 5)}. `), `${sent.length} of ${counted(all.length, "file")} are safe. Sending continues automatically; you can close this page and come back.`) : null,
    queue.refusal ? refusalOf(state, queue) : null,
    open.length ? h("p", { class: "small" }, placesOf(open)) : null,
    notes.length ? h("p", { class: "muted small" }, notes.join(" · ")) : null,
    failed.length ? causeList(refusedFiles(queue, failed)) : null,
    h("p", { class: "actions" },
      queue.refusal ? null : open.length || failed.length ? button(open.length ? `Send ${counted(open.length, "file")}` : "Try again", "send", (event) => act(event.target, () => queue.send()), { class: "primary" }) : null,
      unmeasured ? h("a", { class: "button primary", href: "#region" }, "Draw region") : null,
      retrying.length ? button("Try now", "now", () => queue.retryNow()) : null,
      sent.length + there.length === queue.items.length ? button("Receipt", "receipt", (event) => act(event.target, () => saveReceipt(state, queue.items, given)), { title: "A signed statement that these files are stored: the card may be formatted" }) : null,
      // the second press of a double click on "Send" meets the button that took its place
      moving.length ? button("Stop", "stop", (event) => event.detail > 1 || queue.stop()) : button("Remove all", "clear", () => queue.drop([...queue.items]), { class: "quiet" }),
    ),
  ];
}

/** As what the files are sent: "Light frames, level-1: 3 · Dark frames: 2". */
function placesOf(items) {
  const groups = [...groupBy(items, (item) => [`${roleLabel(item.role)} frames`, item.scene].filter(Boolean).join(", "))];
  const named = groups.slice(0, MOST_NAMED).map(([name, some]) => `${name}: ${some.length}`);
  return [...named, groups.length > MOST_NAMED && `and ${groups.length - MOST_NAMED} more`].filter(Boolean).join(" · ");
}

const refusedFiles = (queue, failed) =>
  [...groupBy(failed, (item) => item.error)].map(([error, some]) => ({ mark: "bad", title: `${counted(some.length, "file")} not sent`, where: `${error} (${some.slice(0, MOST_NAMED).map((item) => item.name.split("/").at(-1)).join(", ")}${some.length > MOST_NAMED ? ` and ${some.length - MOST_NAMED} more` : ""})`, actions: [small("Remove", () => queue.drop(some), { quiet: true })] }));

async function saveReceipt(state, items, given) {
  const files = items.map(({ name, size, sha256 }) => ({ name, size_bytes: size, sha256 }));
  const others = [...given].filter(([name]) => !items.some((item) => item.name === name)).map(([name, size]) => ({ name, size_bytes: size }));
  const { complete, missing, receipt } = await post(`${state.path}/manifest`, { files, others });
  if (complete) h("a", { href: receipt, download: "" }).click();
  else toast(`${counted(missing.length, "file")} of ${files.length} ${missing.length === 1 ? "is" : "are"} not stored whole. Keep the card and send it again.`);
}

function refusalOf(state, queue) {
  const { refusal } = queue;
  const title = refusal.sent ? `Sending stopped after ${counted(refusal.sent, "file")}` : "Sending stopped after the first file";
  const refused = state.byId.get(refusal.item.frameId);
  const go = h("button", { type: "button", class: "small-button", "data-keep": "go-on", onclick: (event) => act(event.target, () => queue.goOn()) }, `Send the other ${refusal.left}`);
  return h("div", { class: "failed", role: "alert" }, h("p", { class: "failed-title" }, title), h("p", {}, `${refusal.item.name.split("/").at(-1)}: ${refusal.detail} ${refusal.left === 1 ? "The other file was" : `The other ${refusal.left} were`} not sent.`), h("p", { class: "actions" }, go, refused ? mendButtons(state, refusal.code, [refused]) : null));
}

/** What a frame waits for, by the code of its verdict; by none of these a worker reads it. */
const WAITS = { no_region: "waiting for a region", reading_missing: "waiting for a reading" };

const PASSES = { pass: "pass", warn: "to check", fail: "fail" };

function standingOf(state, item) {
  const { outcome, code } = state.byId.get(item.frameId) ?? {};
  return PASSES[outcome] ?? WAITS[code] ?? "in progress";
}

/** "38 of 38 received, 36 pass, 2 to check"; what all wait for, without its count. */
function outcomeOf(state, sent) {
  const counts = groupBy(sent, (item) => standingOf(state, item));
  return [`${sent.length} of ${sent.length} received`, ...[...counts].map(([standing, { length }]) => (counts.size === 1 && standing.startsWith("waiting") ? standing : `${length} ${standing}`))].join(", ");
}
