// Every frame of the campaign in a table: thumbnail, exposure, signal and verdict; selected frames are changed together.

import { patch } from "../api.js";
import { byId, filename, fill, h, may, toast } from "../dom.js";
import { exposureTime, fixed, number, percent, tag, words } from "../format.js";
import { roleOptions } from "../methods.js";
import { act, empty } from "../states.js";
import { showFrame } from "./detail.js";
import { select } from "./forms.js";
import { countOutcomes } from "./overview.js";
import { isRead } from "./state.js";
import { virtualTable } from "./virtual.js";

const ROW_PX = 60;
const collator = new Intl.Collator(undefined, { numeric: true });
const RANKS = ["fail", "warn", "pending", "pass"];

export function framesSection(state) {
  const chosen = new Set();
  const view = { outcome: "", text: "", order: "name" };
  const tools = h("div", { class: "frame-tools" });
  const bulk = h("div", { class: "bulk card", hidden: true });
  const bare = h("div");
  const grid = virtualTable({
    columns: [
      { head: may("calibrate") ? everyone() : h("span", { class: "hidden" }, "Select"), class: "pick" },
      { head: h("span", { class: "hidden" }, "Image"), class: "thumb" },
      { head: "Frame", class: "name" },
      { head: "Exposure", class: "wide-only exposure" },
      { head: "Signal [DN]", class: "number wide-only signal" },
      { head: "Clipped", class: "number wide-only clipped" },
      { head: "Verdict", class: "verdict" },
    ],
    rowHeight: ROW_PX,
    caption: "Received frames",
    draw: (frame) => cells(frame),
    keyOf: (frame) => frame.id,
    markOf: (frame) => JSON.stringify([frame.state, frame.role, frame.scene, frame.exposure_time_s, frame.iso, signalOf(frame), state.verdicts.get(frame.id), chosen.has(frame.id)]),
  });

  function everyone() {
    return h("input", { type: "checkbox", "aria-label": "Select all listed frames", onchange: (event) => {
      for (const frame of listed()) if (event.target.checked) chosen.add(frame.id); else chosen.delete(frame.id);
      draw();
    } });
  }

  function signalOf(frame) {
    const rows = state.statisticsOf(frame);
    const green = rows.filter((row) => ["G1", "G2", "G"].includes(row.channel));
    const used = green.length ? green : rows.filter((row) => row.channel === "grey" || rows.length === 1);
    if (!used.length) return null;
    const mean = (name) => used.reduce((sum, row) => sum + row[name], 0) / used.length;
    return { mean: mean("mean_dn"), std: mean("std_dn"), clipped: Math.max(...rows.map((row) => row.saturated_share)) };
  }

  function cells(frame) {
    const signal = signalOf(frame);
    return [
      may("calibrate")
        ? h("input", { type: "checkbox", checked: chosen.has(frame.id), "aria-label": `Choose ${frame.filename}`, onchange: (event) => {
            if (event.target.checked) chosen.add(frame.id);
            else chosen.delete(frame.id);
            drawBulk();
          } })
        : null,
      isRead(frame)
        ? h("img", { src: `/v1/frames/${frame.id}/thumbnail.png`, alt: "", loading: "lazy", decoding: "async", width: 60, height: 42 })
        : h("span", { class: "no-picture", "aria-hidden": "true" }),
      [
        h("button", { type: "button", class: "link", onclick: () => showFrame(state, frame.id) }, filename(frame.filename)),
        h("span", { class: "sub" }, [frame.roi_origin === "found" ? `${frame.role}, found` : frame.role, frame.scene, frame.band && words(frame.band)].filter(Boolean).join(" · ")),
      ],
      frame.exposure_time_s ? [exposureTime(frame.exposure_time_s), h("span", { class: "sub" }, `f/${number(frame.f_number, 3)} · ISO ${number(frame.iso, 6)}`)] : h("span", { class: "muted" }, "–"),
      signal ? [fixed(signal.mean, 1), h("span", { class: "sub" }, `± ${number(signal.std, 3)}`)] : h("span", { class: "muted" }, "–"),
      signal ? h("span", { class: signal.clipped > 0.001 ? "bad-figure" : "muted" }, signal.clipped === 0 ? "0" : percent(signal.clipped)) : h("span", { class: "muted" }, "–"),
      verdictCell(state.verdicts.get(frame.id)),
    ];
  }

  function listed() {
    const wanted = view.text.toLowerCase();
    const found = state.frames.filter((frame) => {
      const outcome = state.verdicts.get(frame.id)?.outcome;
      return (!view.outcome || outcome === view.outcome) && `${frame.filename} ${frame.role} ${frame.scene ?? ""}`.toLowerCase().includes(wanted);
    });
    const by = {
      name: (a, b) => collator.compare(a.filename, b.filename),
      scene: (a, b) => collator.compare(a.scene ?? "", b.scene ?? "") || collator.compare(a.filename, b.filename),
      verdict: (a, b) => RANKS.indexOf(state.verdicts.get(a.id)?.outcome) - RANKS.indexOf(state.verdicts.get(b.id)?.outcome),
      signal: (a, b) => (signalOf(a)?.mean ?? -1) - (signalOf(b)?.mean ?? -1),
    }[view.order];
    return by ? found.sort(by) : found;
  }

  function draw() {
    const some = state.frames.length > 0;
    grid.element.hidden = tools.hidden = !some;
    fill(bare, some ? null : empty("No frames yet", may("upload") ? "Drop the camera’s files above, or send a folder with: stilb push." : "No frames have been sent."));
    if (some) grid.show(listed());
    byId("frames-note").textContent = some ? `${number(state.frames.length, 6)}${state.complete ? "" : " and more"} of this campaign` : "";
    drawCounts();
    drawBulk();
  }

  const outcomes = h("div", { class: "segments", role: "group", "aria-label": "Which frames" });
  function drawCounts() {
    const counts = countOutcomes(state);
    const options = [["", "All", state.frames.length], ...["pass", "warn", "fail", "pending"].map((name) => [name, name, counts[name]])];
    const focused = outcomes.contains(document.activeElement) ? document.activeElement.dataset.outcome : undefined;
    fill(outcomes, options.filter(([name, , count]) => name === "" || count || view.outcome === name).map(([name, text, count]) =>
      h("button", { type: "button", "aria-pressed": String(view.outcome === name), "data-outcome": name, onclick: () => ((view.outcome = name), draw()) }, text, " ", h("small", {}, String(count)))));
    if (focused !== undefined) outcomes.querySelector(`[data-outcome="${focused}"]`)?.focus();
  }

  function drawBulk() {
    for (const id of chosen) if (!state.byId.has(id)) chosen.delete(id);
    if (bulk.hidden === (chosen.size === 0)) {
      if (chosen.size) bulk.querySelector(".bulk-count").textContent = `${chosen.size} chosen`;
      return;
    }
    bulk.hidden = chosen.size === 0;
    if (!bulk.hidden) fill(bulk, bulkForm(state, chosen, () => draw()));
  }

  fill(
    tools,
    outcomes,
    h("input", { type: "search", "aria-label": "Find a frame", placeholder: "Name, role or scene", oninput: (event) => ((view.text = event.target.value.trim()), draw()) }),
    h("label", { class: "order" }, "Order ", select([["name", "by name"], ["arrival", "by arrival"], ["scene", "by scene"], ["verdict", "worst first"], ["signal", "by signal"]], { onchange: (event) => ((view.order = event.target.value), draw()) })),
  );
  state.on("frames", draw);
  draw();
  return [bare, tools, bulk, grid.element];
}

function verdictCell(verdict) {
  if (!verdict) return h("span", { class: "muted" }, "…");
  const [first] = verdict.reasons;
  return [tag(verdict.outcome), first ? h("span", { class: "why", title: first.detail }, first.detail) : null];
}

function bulkForm(state, chosen, after) {
  const role = select([["", "keep"], ...roleOptions(state.method)], { "aria-label": "Role of the selected frames" });
  const scene = h("input", { "aria-label": "Scene of the selected frames", placeholder: "keep", list: "scenes" });
  const apply = async () => {
    const said = { ...(role.value ? { role: role.value } : {}), ...(scene.value.trim() ? { scene: scene.value.trim() } : {}) };
    if (!Object.keys(said).length) return;
    const ids = [...chosen];
    for (const id of ids) {
      state.renew(await patch(`/v1/frames/${id}`, said));
      chosen.delete(id);
    }
    toast(`${ids.length} changed and read again.`);
    after();
    await state.touch();
  };
  return [
    h("strong", { class: "bulk-count" }, `${chosen.size} chosen`),
    h("label", {}, "Role ", role),
    h("label", {}, "Scene ", scene),
    h("datalist", { id: "scenes" }, state.scenes.map((name) => h("option", { value: name }))),
    h("span", { class: "actions" }, h("button", { type: "button", class: "primary", onclick: (event) => act(event.target, apply) }, "Change"), h("button", { type: "button", class: "quiet", onclick: () => (chosen.clear(), after()) }, "Clear selection")),
  ];
}
