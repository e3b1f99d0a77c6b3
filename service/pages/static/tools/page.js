// A calculator: its form as the API's schema states it, its answers side by side.

import { send } from "../api.js";
import { act, byId, fill, h, prose, table, wrong } from "../dom.js";
import { WRITTEN, capital, headOf, number, quantity, tag, titleOf } from "../format.js";
import { field, numberOf } from "../ask.js";
import { TOOLS } from "../calculators.js";

const { tool } = document.querySelector("main").dataset;
const { form: schema, answer: answers, takes_table: takesTable } = TOOLS[tool];
const KNOWN = { ...schema.properties, ...answers.properties };
const path = `/v1/tools/${tool}`;
const EXAMPLE = "exposure_time_s,f_number,iso,signal_dn\n0.001,4,200,410\n0.002,4,200,812\n0.004,4,200,1615\n0.008,4,200,3220";
const labelled = (sentence) => sentence?.replace(/`?\b([a-z]+(?:_[a-z0-9]+)+)\b`?/g, (all, name) => (name in KNOWN ? headOf(name).filter(Boolean).join(" in ") : all));
const told = (sentence) => prose(labelled(sentence));
const plainly = (error) => Promise.reject(error.errors?.length ? wrong(error.errors.map(({ field: place, message }) => `${capital(labelled([place.replace(/^(body|query)(\.\d+)?\.?/, ""), message].filter(Boolean).join(" ")))}.`).join(" ")) : error);

const inputs = Object.entries(schema.properties).map(([name, stated]) => {
  const type = stated.anyOf?.[0] ?? stated;
  const isText = type.type === "string";
  const input = h("input", { autocomplete: "off", inputmode: isText ? null : "decimal", value: stated.default ?? null, required: schema.required?.includes(name) });
  const title = titleOf(WRITTEN[name] && !headOf(name)[1] ? [WRITTEN[name][0], ""] : headOf(name));
  return { name, input, isText, minimum: type.minimum ?? type.exclusiveMinimum, maximum: type.maximum, title, element: field(title, input, hintOf(stated, type), `/docs/tools#${name}`) };
});
const rows = takesTable ? h("textarea", { rows: 8, class: "mono", spellcheck: "false", required: true }, EXAMPLE) : null;
let cases = [];

const again = h("button", { type: "button", hidden: true, onclick: (event) => form.reportValidity() && act(event.target, () => compute(cases)) }, "Compare with this, too");
const form = h("form", { class: "card", onsubmit: (event) => (event.preventDefault(), act(event.submitter ?? form.querySelector("[type=submit]"), () => compute([]))) },
  rows ? field("Rows", rows, "One frame a line, pasted from a spreadsheet with its head.", "/docs/tools#exposure") : null,
  h("div", { class: "fields" }, inputs.map((each) => each.element)),
  h("p", { class: "actions" }, h("button", { type: "submit", class: "primary" }, "Compute"), again),
);
fill(byId("calculator"), form).removeAttribute("aria-busy");
const kept = new URLSearchParams(location.search);
for (const { name, input } of inputs) if (kept.has(name)) input.value = kept.get(name);
if (kept.size && form.checkValidity()) form.requestSubmit();

function hintOf({ description }, { minimum, maximum, type }) {
  const range = type === "string" || minimum === undefined ? "" : `Between ${number(minimum)} and ${number(maximum)}.`;
  return [description ? [told(description), " "] : null, range];
}

function read() {
  const said = inputs.map(({ name, input, isText, title, minimum, maximum }) => {
    const [, above, below] = (name === "exposure_time_s" && /^\s*(\d+)\/(\d+)( ?s)?\s*$/.exec(input.value)) || [];
    const value = isText ? input.value.trim() || undefined : below ? above / below : numberOf(input);
    if (!isText && (value < minimum || value > maximum)) throw wrong(`${title}: between ${number(minimum)} and ${number(maximum)}.`);
    return [name, value];
  });
  return Object.fromEntries(said.filter(([, value]) => value !== undefined));
}

async function compute(earlier) {
  const typed = read();
  history.replaceState(history.state, "", `${location.pathname}?${new URLSearchParams(typed)}`);
  const asked = rows ? { path: `?${new URLSearchParams(typed)}`, sent: { body: rows.value, headers: { "Content-Type": "text/csv" } } } : { path: "", sent: { json: [...earlier, typed] } };
  const answer = await (await send("POST", `${path}${asked.path}`, asked.sent).catch(plainly)).json();
  cases = rows ? [] : [...earlier, typed];
  again.hidden = Boolean(rows);
  byId("answer-section").hidden = false;
  fill(byId("answer"), answer.flags?.length ? h("p", { class: "note warn" }, answer.flags.map((each) => [tag(each.flag, "warn"), " ", each.detail])) : null, side(answer.items ?? [answer]));
}

function side(found) {
  const names = Object.keys(answers.properties).filter((name) => name !== "name" && name !== "flags" && found.some((each) => each[name] !== undefined));
  const columns = [
    { head: "Quantity", header: true, cell: (name) => [titleOf(WRITTEN[name] ? [WRITTEN[name][0], ""] : headOf(name)), h("span", { class: "sub" }, told(answers.properties[name].description))] },
    ...found.map((each, place) => ({ head: each.name ?? (found.length > 1 ? `Case ${place + 1}` : "Value"), class: "number", cell: (name) => say(name, each[name]) })),
  ];
  return table(columns, names, { caption: "Results" });
}

function say(name, value) {
  if (value === undefined) return "–";
  if (WRITTEN[name] && typeof value === "number") return WRITTEN[name][1](value);
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "number") return headOf(name)[1] === "%" ? `${number(100 * value, 3)} %` : number(value);
  if (Array.isArray(value)) return value.length ? value.map((each) => h("div", { class: "nowrap" }, Array.isArray(each) ? each.map((one) => number(one)).join(", ") : `row ${each.row}: ${each.reason}`)) : "none";
  if (value.standard_uncertainty !== undefined) return quantity(value);
  if (typeof value === "object") return Object.entries(value).map(([part, each]) => h("div", { class: "nowrap" }, `${titleOf([headOf(part)[0]])}: `, typeof each === "number" ? number(each) : quantity(each)));
  return String(value);
}
