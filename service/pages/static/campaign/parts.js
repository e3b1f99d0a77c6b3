// The parts of a campaign's page that come after its frames, each with its place there.

import { all, get, getOr, patch, runJob } from "../api.js";
import { ask } from "../ask.js";
import { act, byId, empty, fill, h, leave, load, may, table, toast, wrong } from "../dom.js";
import { ago, counted, groupBy, number, quantity, tag, time } from "../format.js";
import { measurementTable } from "../measurement/words.js";
import { coefficientLabel, headlineOf } from "../methods.js";
import { detailsPart } from "./details.js";
import { inTimePart } from "../timeline.js";
import { readinessOf } from "../causes.js";
import { parametersFold, statedPart, withManual } from "./parameters.js";
import { regionSection } from "./region.js";
import { isRead } from "./state.js";
import { targetSection } from "./target.js";

function checklistSection(state) {
  const element = h("div");
  const opened = new Set();
  const show = (list) => {
    if (state.left) return null;
    state.checklist = list;
    state.tell("checklist");
    byId("checklist-note").textContent = `${list.done} of ${list.done + list.open} done`;
    return body(list, opened, change);
  };
  const read = () => load(element, () => get(`${state.path}/checklist`), show);
  /** A list that is signed asks for a new signature; what else is wrong is thrown. */
  async function change(said) {
    try {
      fill(element, show(await patch(`${state.path}/checklist`, said)));
    } catch (error) {
      if (error.code !== "checklist_signed") throw error;
      signAgain(said);
    }
  }
  const signAgain = (said) => ask({
    title: "The list is signed",
    body: h("p", {}, "A change needs a new signature, which then applies to the changed list."),
    fields: [{ name: "name", label: "Operator", of: "NewSignature" }],
    submit: "Change and sign",
    action: ({ name }) => change({ ...said, signature: { name } }),
  });

  // what the record proves follows the frames
  state.on("campaign", read);
  read();
  return element;
}

function body(list, opened, change) {
  const sections = groupBy(list.items, (item) => item.section);
  return [
    h("div", { class: "checklist" }, [...sections].map(([section, items]) => group(section, items, opened, change))),
    signature(list, change),
  ];
}

function group(section, items, opened, change) {
  const done = items.filter((item) => item.done_by).length;
  const details = h("details", { open: opened.has(section), ontoggle: () => (details.open ? opened.add(section) : opened.delete(section)) },
    h("summary", { "data-keep": section }, h("span", {}, section), h("span", { class: `tag ${done === items.length ? "good" : ""}` }, `${done} of ${items.length}`)),
    h("ul", { class: "plain" }, items.map((item) => line(item, change))),
  );
  // what the record shows undone is not ticked with the others
  const open = items.filter((item) => !item.done_by && !item.missing);
  const all = open.length && may("calibrate") ? h("button", { type: "button", class: "small-button", "data-keep": section, onclick: (event) => act(event.target, () => change({ items: open.map(({ key }) => ({ key, done: true })) })) }, `Tick ${open.length}`, h("span", { class: "hidden" }, ` open items of ${section}`)) : null;
  return h("div", { class: "section" }, details, all);
}

function line(item, change) {
  const own = item.done_by === "stilb";
  const box = h("input", {
    type: "checkbox",
    checked: Boolean(item.done_by),
    disabled: !may("calibrate"),
    "data-keep": item.key,
    onchange: ({ target }) =>
      change({ items: [{ key: item.key, done: target.checked }] }).catch((error) => {
        target.checked = !target.checked;
        toast(error.message);
      }),
  });
  const note = () => ask({
    title: "Note",
    body: h("p", { class: "muted" }, item.text),
    fields: [{ name: "note", label: "What was done, and with which equipment", of: "ItemChange", type: "textarea", value: item.note ?? "" }],
    submit: "Save",
    action: (said) => change({ items: [{ key: item.key, done: box.checked, note: said.note }] }),
  });
  return h("li", {},
    h("label", { class: "check" }, box, h("span", {}, item.text)),
    item.evidence || item.missing || item.note || item.done_at
      ? h("div", { class: "evidence" },
          item.evidence ? h("p", {}, h("span", { class: "tag good" }, own ? "from the record" : "record agrees"), " ", item.evidence) : null,
          item.missing ? h("p", { class: "muted" }, item.missing) : null,
          item.note ? h("p", {}, "“", item.note, "”") : null,
          item.done_by && !own ? h("p", { class: "muted" }, "Ticked ", time(item.done_at)) : null,
        )
      : null,
    may("calibrate") ? h("button", { type: "button", class: "quiet", "aria-label": `Note on: ${item.text}`, onclick: note }, "Note") : null,
  );
}

function signature(list, change) {
  const { signature: signed } = list;
  const said = signed ? h("p", { class: `note ${signed.changed ? "warn" : "good"}` }, "Signed by ", h("strong", {}, signed.name), ", ", time(signed.signed_at), signed.state_sha256 ? [", for the state ", h("code", { title: signed.state_sha256 }, signed.state_sha256.slice(0, 12))] : null, signed.changed ? ". Details, frames, readings, region or ticks have changed since: check them, and sign again." : ".") : null;
  if (!may("calibrate") || (signed && !signed.changed)) return said;
  const sign = async () => ask({ title: "Sign the checklist", body: list.open ? h("p", {}, `${list.open} items are open. The signature applies to the list as it is.`) : null, fields: [{ name: "name", label: "Operator", of: ["NewSignature", "name"], value: (await getOr("/v1/keys/own", {})).person, hint: "As signed below the printed checklist." }], submit: "Sign", action: ({ name }) => change({ signature: { name } }) });
  return [said, h("p", { class: "actions" }, h("button", { type: "button", onclick: sign }, signed ? "Sign again" : "Sign the checklist"))];
}

function calibrateSection(state) {
  const versions = h("div");
  load(versions, () => all(`${state.path}/calibrations`), (found) => ((state.fitted = found), state.tell("fitted"), found.length ? list(found) : empty("No versions yet", "Every fit makes a version of the camera’s calibration, which is a draft until it is published.")));
  return h("div", { class: "columns calibrate" }, may("calibrate") ? starter(state) : null, versions);
}

function starter(state) {
  const parameters = parametersFold(state.method, state.campaign.camera_id);
  const given = state.method.parameters.filter((each) => each.given_by === "campaign");
  const stated = statedPart(withManual(given, state.method), Object.fromEntries(given.map((each) => [each.field, state.campaign[each.name]])));
  const [progress, lacking] = [h("p", { class: "muted small", role: "status" }), h("div")];
  const button = h("button", { class: "primary", type: "submit" }, coefficientLabel(state.method.name, headlineOf(state.method.name)).endsWith(" K") ? "Fit K" : "Fit");
  const draw = () => {
    const { count, said } = readinessOf(state.campaign, state.sending);
    fill(lacking, h("p", { class: "muted small" }, count ? h("a", { href: "#before" }, `${counted(count, "thing")} needed before the fit`) : said === "ready" ? "Nothing is missing." : "Frames are on their way."));
  };
  for (const name of ["campaign", "sending"]) state.on(name, draw);
  draw();
  const start = async () => {
    const unused = Object.entries(state.unused).find(([, isChanged]) => isChanged);
    if (unused) throw wrong(`The ${unused[0]} was changed here and is not used yet: use it, or load the page again.`);
    // readings that are typed one after another are stored in turn
    await state.book?.turn;
    const changed = Object.entries(stated.read()).filter(([name, value]) => value !== state.campaign[name]);
    if (changed.length) state.campaign = await patch(state.path, Object.fromEntries(changed));
    try {
      const made = await runJob(`${state.path}/calibrations`, await parameters.read(), progress, "Fitting");
      await leave(`/calibrations/${made.calibration_id}`);
    } catch (error) {
      if (error.code === "campaign_incomplete") state.touch();
      throw error;
    }
  };
  return h("form", { class: "card", onsubmit: (event) => (event.preventDefault(), act(button, start)) },
    h("h3", {}, "New version"),
    lacking,
    given.length ? h("details", { class: "fold" }, h("summary", {}, "Light, distance and verdict"), stated.element) : null,
    parameters.element,
    h("p", { class: "actions" }, button),
    progress,
  );
}

function list(found) {
  const first = (version) => {
    const [coefficient, ...more] = version.coefficients;
    if (!coefficient) return "–";
    const of = [coefficient.iso && `ISO ${coefficient.iso}`, coefficient.f_number && `f/${number(coefficient.f_number, 3)}`, coefficient.band, coefficient.channel].filter(Boolean);
    return [quantity(coefficient), h("span", { class: "sub" }, [coefficientLabel(version.method, coefficient.name), ...of, more.length ? `and ${more.length} more` : ""].filter(Boolean).join(" · "))];
  };
  const columns = [
    { head: "Version", header: true, class: "nowrap", cell: (each) => h("a", { href: `/calibrations/${each.id}` }, `Version ${each.version}`) },
    { head: "State", cell: (each) => tag(each.state) },
    { head: "Result ± u", cell: first },
    { head: "Flags", cell: (each) => number(new Set(each.coefficients.flatMap((c) => c.flags)).size) },
    { head: "Created", class: "nowrap", cell: (each) => h("time", { datetime: each.created_at, title: each.created_at }, ago(each.created_at)) },
  ];
  return table(columns, found, { caption: "Versions fitted from this campaign" });
}

function nightSection(state) {
  const results = h("div");
  const head = h("div");
  const show = () => load(results, () => get(`/v1/measurements?campaign_id=${state.id}&limit=100`), ({ items, next }) => (items.length ? [measurementTable(items), next ? h("p", {}, h("a", { href: `/measurements?campaign_id=${state.id}` }, "All measurements of this night")) : null] : empty("No measurements yet", "Frames are measured with the published calibration of their camera.")));
  const draw = () => {
    const file = (name, text) => h("a", { class: "button quiet", href: name, download: "" }, text);
    const of = `${state.path}/measurements`;
    fill(head,
      h("p", { class: "muted" }, `${state.campaign.measured} of ${counted(state.frames.filter(isRead).length, "frame")} measured.`),
      h("p", { class: "actions" },
        may("upload") && state.frames.some(isRead) ? h("a", { class: "button primary", href: `/measurements/new?campaign=${state.id}&all` }, "Measure all frames") : null,
        may("upload") && state.frames.some(isRead) ? h("a", { class: "button", href: `/measurements/new?campaign=${state.id}` }, "Measure a frame") : null,
        state.campaign.measured ? [file(`/v1/series/measurements?campaign_id=${state.id}&format=csv`, "CSV"), file(`${of}.geojson`, "GeoJSON"), file(`/v1/series/measurements?campaign_id=${state.id}&format=json`, "JSON")] : null,
      ),
    );
  };
  state.on("campaign", draw);
  draw();
  show();
  return [head, results];
}

export { uploadSection } from "./upload.js";

export const PARTS = [
  ["details-buttons", detailsPart],
  ["in-time", inTimePart],
  ["target-form", targetSection],
  ["region-tool", regionSection],
  ["checklist-items", checklistSection],
  ["calibrate-tool", calibrateSection],
  ["night-tool", nightSection],
];
