// The procedure's checklist: items that the record proves are ticked automatically, the others by people; then it is signed.

import { get, patch } from "../api.js";
import { ask } from "../ask.js";
import { byId, fill, h, may, toast } from "../dom.js";
import { time } from "../format.js";
import { groupBy } from "../groups.js";
import { act, failed, loading } from "../states.js";

export function checklistSection(state) {
  const element = h("div", {}, loading(3));
  const opened = new Set();
  const draw = (list) => {
    if (state.left) return;
    state.checklist = list;
    state.tell("checklist");
    byId("checklist-note").textContent = `${list.done} of ${list.done + list.open} done`;
    fill(element, body(list, opened, change));
  };
  const read = async () => {
    try {
      draw(await get(`${state.path}/checklist`));
    } catch (error) {
      fill(element, failed(error, read));
    }
  };
  /** A list that is signed asks for a new signature; what else is wrong is thrown. */
  async function change(said) {
    try {
      draw(await patch(`${state.path}/checklist`, said));
    } catch (error) {
      if (error.code !== "checklist_signed") throw error;
      signAgain(said);
    }
  }
  const signAgain = (said) =>
    ask({
      title: "The list is signed",
      body: h("p", {}, "A change needs a new signature, which then applies to the changed list."),
      fields: [{ name: "name", label: "Operator", of: "NewSignature" }],
      submit: "Change and sign",
      action: async ({ name }) => draw(await patch(`${state.path}/checklist`, { ...said, signature: { name } })),
    });

  // what the record proves follows the frames, but nobody waits for it while files stream in; a signature is told at once
  // that it no longer holds
  let seen = "";
  let stale = false;
  let near = false;
  const refresh = () => {
    const now = JSON.stringify([state.campaign.frames, state.campaign.readings, state.roi?.id]);
    // there and back again is a change too: what is shown may be from between
    stale ||= now !== seen;
    seen = now;
    if (stale && (near || state.checklist?.signature) && !element.contains(document.activeElement)) {
      stale = false;
      read();
    }
  };
  state.on("campaign", refresh);
  element.addEventListener("focusout", () => requestAnimationFrame(refresh));
  state.on("versions", read);
  new IntersectionObserver((entries) => {
    near = entries.some((entry) => entry.isIntersecting);
    if (near) refresh();
  }, { rootMargin: "600px" }).observe(element);
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
  const details = h(
    "details",
    { open: opened.has(section), ontoggle: () => (details.open ? opened.add(section) : opened.delete(section)) },
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
  const note = () =>
    ask({
      title: "Note",
      body: h("p", { class: "muted" }, item.text),
      fields: [{ name: "note", label: "What was done, and with which equipment", of: "ItemChange", type: "textarea", value: item.note ?? "" }],
      submit: "Save",
      action: (said) => change({ items: [{ key: item.key, done: box.checked, note: said.note }] }),
    });
  return h(
    "li",
    {},
    h("label", { class: "check" }, box, h("span", {}, item.text)),
    item.evidence || item.missing || item.note || item.done_at
      ? h(
          "div",
          { class: "evidence" },
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
  const sign = () => ask({ title: "Sign the checklist", body: list.open ? h("p", {}, `${list.open} items are open. The signature applies to the list as it is.`) : null, fields: [{ name: "name", label: "Operator", of: ["NewSignature", "name"], hint: "As signed below the printed checklist." }], submit: "Sign", action: ({ name }) => change({ signature: { name } }) });
  return [said, h("p", { class: "actions" }, h("button", { type: "button", onclick: sign }, signed ? "Sign again" : "Sign the checklist"))];
}
