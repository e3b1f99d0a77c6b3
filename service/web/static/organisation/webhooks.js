// Addresses that are told of the organisation's events: made, edited, tested, and the log of what each was sent.

import { all, get, patch, pathOf, post, send } from "../api.js";
import { ask } from "../ask.js";
import { about, boxes } from "../campaign/forms.js";
import { small } from "../causes.js";
import { byId, fill, h, may, table, toast } from "../dom.js";
import { ago, counted, day, tag, time, words } from "../format.js";
import { follow } from "../live.js";
import { mark } from "../marks.js";
import { act, empty, load } from "../states.js";
import { tellSecret } from "./secret.js";

const EVENTS = JSON.parse(byId("main").dataset.events);
const SHOWN = 50;
const MARKS = { delivered: "good", queued: "wait", failed: "bad" };
const eventName = (event) => words(event.replace(".", ": "));

let logged = null;
let following = null;

const show = () => load(byId("webhooks"), () => all("/v1/webhooks"), draw);

function draw(hooks) {
  if (!hooks.length) return empty("No webhooks", "A webhook has events sent to an address, such as a version that was published.");
  const columns = [
    { head: "Address", header: true, cell: (hook) => [mark(judge(hook)), " ", h("span", { class: "hash" }, hook.url), h("span", { class: "sub" }, `added ${day(hook.created_at)}`)] },
    { head: "Events", cell: (hook) => h("span", { class: "chips" }, hook.events.map((event) => h("span", { class: "chip" }, eventName(event)))) },
    { head: "State", cell: stateOf },
    { head: "", class: "number", cell: buttons },
  ];
  return table(columns, hooks, { caption: "Webhooks", stack: true });
}

const judge = (hook) => (hook.disabled_at ? "out" : hook.failing_since ? "warn" : "good");

function stateOf(hook) {
  if (hook.disabled_at) return [tag("disabled"), " ", hook.disabled_reason];
  return hook.failing_since ? [tag("failing", "warn"), " since ", h("time", { datetime: hook.failing_since, title: hook.failing_since }, ago(hook.failing_since))] : "In use";
}

function buttons(hook) {
  const path = `/v1/webhooks/${hook.id}`;
  const of = (text, action, more = {}) => {
    const button = small(text, () => act(button, action), { "aria-label": `${text.replace("…", "")}: ${hook.url}`, ...more });
    return button;
  };
  const enable = async (enabled) => {
    await patch(path, { enabled });
    await show();
  };
  const test = async () => {
    await post(`${path}/test`, {});
    toast("The test event is queued.");
    openLog(hook);
  };
  return h("span", { class: "actions" }, of("Log", () => openLog(hook)), hook.disabled_at ? of("Enable", () => enable(true)) : [of("Test", test), of("Disable", () => enable(false))], of("Edit…", () => edit(hook)), of("Remove…", () => remove(hook), { class: "small-button danger" }));
}

/** The address and the events of a webhook, asked in a dialog; `action` has both. */
const askFor = (title, submit, hook, action) =>
  ask({
    title,
    fields: [{ name: "url", label: "Address", type: "url", value: hook.url, of: "NewWebhook", maxlength: 1000 }],
    after: boxes("Events", about("NewWebhook", "events"), EVENTS.map((event) => h("label", { class: "check" }, h("input", { type: "checkbox", name: `event-${event}`, checked: hook.events.includes(event) }), eventName(event)))),
    submit,
    action: ({ url, ...ticked }) => action({ url, events: EVENTS.filter((event) => ticked[`event-${event}`]) }),
  });

async function make() {
  const hook = await askFor("New webhook", "Add webhook", { events: ["calibration.published"] }, (said) => post("/v1/webhooks", said));
  if (!hook) return;
  tellSecret(hook.secret, "The webhook is added. This secret verifies its signatures.");
  await show();
}

async function edit(hook) {
  if (await askFor("Edit webhook", "Save", hook, (said) => patch(`/v1/webhooks/${hook.id}`, said))) await show();
}

async function remove(hook) {
  const gone = await ask({
    title: "Remove this webhook?",
    body: h("p", {}, `Nothing is sent to ${hook.url} from now on, and the log of its deliveries is deleted. This cannot be undone.`),
    submit: "Remove webhook",
    danger: true,
    action: async () => (await send("DELETE", `/v1/webhooks/${hook.id}`)).json(),
  });
  if (!gone) return;
  if (logged?.id === hook.id) closeLog();
  await show();
}

function closeLog() {
  following?.stop();
  logged = null;
  byId("log-section").hidden = true;
}

function openLog(hook) {
  closeLog();
  logged = hook;
  byId("log-section").hidden = false;
  byId("log-title").textContent = `Deliveries to ${new URL(hook.url).host}`;
  byId("log-title").focus();
  let before = "";
  following = follow(async () => {
    const page = await get(`/v1/webhooks/${hook.id}/deliveries?limit=${SHOWN}`);
    if (logged !== hook || JSON.stringify(page) === before) return;
    before = JSON.stringify(page);
    drawLog(hook, page.items, page.next);
  });
}

function drawLog(hook, items, next) {
  const older = byId("older");
  older.hidden = !next;
  older.onclick = () =>
    act(older, async () => {
      // what is read back to is not replaced by the newest
      following?.stop();
      const page = await get(pathOf(next));
      drawLog(hook, [...items, ...page.items], page.next);
    });
  fill(byId("log"), items.length ? table(logColumns(hook), items, { caption: counted(items.length, "delivery").replace("deliverys", "deliveries"), stack: true }) : empty("Nothing was sent yet", "Send a test event to see whether the address answers."));
}

const logColumns = (hook) => [
  { head: "Queued", header: true, cell: (each) => [mark(MARKS[each.state]), " ", time(each.created_at)] },
  { head: "Event", cell: (each) => [eventName(each.event), h("details", {}, h("summary", { class: "small" }, "Data"), h("pre", { class: "small" }, JSON.stringify(each.data, null, 1)))] },
  { head: "State", cell: (each) => [words(each.state), each.status ? `, answer ${each.status}` : "", h("span", { class: "sub" }, [each.attempts ? counted(each.attempts, "attempt") : "", each.due_at && each.attempts ? `next ${ago(each.due_at)}` : ""].filter(Boolean).join(", ")), each.error ? h("span", { class: "sub" }, each.error) : null] },
  {
    head: "",
    class: "number",
    cell: (each) => {
      const again = async () => {
        await post(`/v1/webhooks/${hook.id}/deliveries/${each.id}/retry`, {});
        toast("It is queued, and sent at once.");
        openLog(hook);
      };
      const button = small("Send again", () => act(button, again), { "aria-label": `Send again: ${eventName(each.event)} of ${each.created_at}` });
      return hook.disabled_at ? "" : button;
    },
  },
];

if (may("admin")) {
  byId("new-webhook").addEventListener("click", make);
  show();
}
