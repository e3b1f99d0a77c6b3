// A card on the first page: dropped or chosen, read here, looked at once, and sent with one button.

import { all, get, newOnce, post } from "../api.js";
import { filesOf } from "../campaign/drop.js";
import { inForce as inForceOf } from "../coefficients.js";
import { fill, h, toast } from "../dom.js";
import { goOn, takeHanded } from "../handover.js";
import { METHODS } from "../methods.js";
import { act, failed } from "../states.js";
import { readCard } from "./files.js";
import { propose } from "./propose.js";
import { cardView } from "./view.js";

/** `zone` takes the card, `place` shows it, and `rest` of the page gives way to it. */
export function startCard(zone, place, rest) {
  const [folder, files] = [chooser({ "aria-label": "Folder to read", webkitdirectory: true }), chooser({ "aria-label": "Files to read" })];
  zone.querySelector("[data-choose=folder]").addEventListener("click", () => folder.click());
  zone.querySelector("[data-choose=files]").addEventListener("click", () => files.click());
  zone.append(folder, files);
  for (const input of [folder, files])
    input.addEventListener("change", () => {
      read([...input.files].map((file) => ({ file, name: file.webkitRelativePath || file.name })));
      input.value = "";
    });
  acceptDrops(zone, read);
  let reading = null;
  const handed = takeHanded();
  if (handed) read(handed);

  async function read(chosen) {
    if (!chosen.length) return;
    reading?.abort();
    const { signal } = (reading = new AbortController());
    const [count, bar] = [h("strong", { role: "status" }), h("progress", { value: 0, max: 1, "aria-label": "Headers read" })];
    show(h("div", { class: "card" }, h("p", { class: "spread" }, count, h("button", { type: "button", class: "small-button", onclick: cancel }, "Stop")), bar));
    const begun = performance.now();
    const onProgress = (done, of) => {
      Object.assign(bar, { value: done, max: of });
      count.textContent = `Reading ${done} of ${of} files`;
    };
    try {
      const [rows, known] = await Promise.all([readCard(chosen, { onProgress, signal }), readKnown()]);
      if (signal.aborted) return;
      const choice = { said: new Map(), leftOut: new Set(), kept: new Set(), cameras: known.cameras };
      await look({ rows, known, choice, answers: new Map(), inForce: known.inForce, seconds: (performance.now() - begun) / 1000, project: { number: "" } });
    } catch (error) {
      if (!signal.aborted) show(failed(error, () => read(chosen)));
    }
  }

  async function look(card) {
    const turn = (card.turn = {});
    const found = await propose(card.rows, { methods: METHODS, ...card.known }, card.choice, card.answers);
    // a late answer never takes the place of a later choice
    if (card.turn !== turn) return;
    card.found = found;
    show(cardView(card, { changed: () => look(card).catch((error) => toast(error.message)), cancel, send: (button) => act(button, () => send(card)) }));
    if (!card.looked) place.querySelector("h1")?.focus();
    card.looked = true;
  }

  function show(...content) {
    rest.hidden = true;
    place.hidden = false;
    fill(place, content);
  }

  function cancel() {
    reading?.abort();
    fill(place).hidden = true;
    rest.hidden = false;
    zone.querySelector("button").focus();
  }
}

const chooser = (attributes) => h("input", { type: "file", multiple: true, hidden: true, ...attributes });

/** The whole window takes a drop. */
function acceptDrops(zone, take) {
  let inside = 0;
  const over = (by) => zone.classList.toggle("over", (inside = Math.max(0, inside + by)) > 0);
  const holdsFiles = (event) => event.dataTransfer?.types.includes("Files");
  const until = new AbortController();
  const on = (name, listener) => addEventListener(name, (event) => (zone.isConnected ? holdsFiles(event) && listener(event) : until.abort()), { signal: until.signal });
  on("dragenter", () => over(1));
  on("dragleave", () => over(-1));
  on("dragover", (event) => event.preventDefault());
  on("drop", async (event) => {
    event.preventDefault();
    over(-inside);
    take(await filesOf(event.dataTransfer));
  });
}

async function readKnown() {
  const [cameras, campaigns, series] = await Promise.all([all("/v1/cameras"), all("/v1/campaigns"), get("/v1/series/coefficients")]);
  return { cameras, campaigns, inForce: inForceOf(series.rows) };
}

/** Create what does not exist yet, then go on to the campaign's page, which sends. */
async function send({ found, choice, project }) {
  const { camera, campaign, frames } = found;
  let id = campaign.campaign?.id;
  if (!id) {
    const { make, model, serial, lens } = camera;
    const cameraId = choice.registered || camera.known?.id || (await post("/v1/cameras", { make, model, serial, lens })).id;
    // a clock without a zone is most likely that of whoever sends
    const [from] = frames.filter((frame) => frame.header.taken).map(({ header: { taken, zoned } }) => taken + (zoned ? 0 : 6e4 * new Date(taken).getTimezoneOffset())).sort((a, b) => a - b);
    const body = { camera_id: cameraId, method: campaign.method, ...(campaign.measures ? { kind: "measurement" } : {}), ...(project.number.trim() ? { project_number: project.number.trim() } : {}), ...(from ? { started_at: new Date(from).toISOString() } : {}) };
    // a second press after a lost answer must not make a second campaign
    id = (await post("/v1/campaigns", body, onceFor(choice, body))).id;
  }
  await goOn(`/campaigns/${id}`, frames.map(({ file, name, role, scene }) => ({ file, name, role, scene })));
}

/** The same idempotency key for the same body. */
function onceFor(choice, body) {
  const said = JSON.stringify(body);
  if (choice.sent?.said !== said) choice.sent = { said, once: newOnce() };
  return { once: choice.sent.once };
}
