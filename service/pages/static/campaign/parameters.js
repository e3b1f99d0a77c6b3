// The form of a fit's parameters, as the specification of its method states them.

import { all } from "../api.js";
import { h, load, prose, wrong } from "../dom.js";
import { capital, day, number, percent, stateWords, unit, words } from "../format.js";
import { decimal, field, manualLink, numberOf, select } from "../ask.js";

const NONE = "none";
const IN_FORCE = "in_force";
let count = 0;

/** {element, read()}: the form in a fold of its own, there once the versions that it offers are known; read() waits for them. */
export function parametersFold(method, cameraId, { former, open = false } = {}) {
  const parameters = method.parameters.filter((each) => each.given_by === "request");
  if (!parameters.length) return { element: null, read: () => ({}) };
  const fields = h("div", { class: "fields" });
  let form;
  const helped = withManual(parameters, method);
  const loading = load(fields, () => readVersions(parameters, cameraId), (versions) => (form = parametersPart(helped, versions, former)).elements);
  const read = async () => {
    await loading;
    if (!form) throw wrong("The parameters of the fit could not be loaded. Open them, and try again there.");
    return form.read();
  };
  return { element: h("details", { class: "fold", open }, h("summary", {}, "Parameters of the fit"), fields), read };
}

export const withManual = (parameters, method) => parameters.map((each) => ({ ...each, manual: `/docs/${method.name}#${each.name}`, members: withManual(each.members, method) }));

async function readVersions(parameters, cameraId) {
  const methods = [...new Set(parameters.map((each) => each.version_of).filter(Boolean))];
  const found = await Promise.all(methods.map((method) => all(`/v1/cameras/${cameraId}/calibrations?method=${method}`)));
  return Object.fromEntries(methods.map((method, place) => [method, found[place]]));
}

/** {element, read()}: what a campaign states, or a measurement of its surroundings. */
export function statedPart(parameters, former) {
  const { elements, read } = parametersPart(parameters, {}, former);
  return { element: h("div", { class: "fields" }, elements), read };
}

/** {elements, read()}: read() leaves out what is at its default. `former`: the parameters of a version, as it stores them. */
function parametersPart(parameters, versions, former) {
  const parts = parameters.map((each) => ({ name: each.name, ...partOf(each, versions, former) }));
  const read = () => Object.fromEntries(parts.map(({ name, read: own }) => [name, own()]).filter(([, value]) => value !== undefined));
  return { elements: parts.map((each) => each.element), read };
}

/** {element, read()} of one parameter; read() gives undefined for the default. */
function partOf(parameter, versions, former) {
  const value = former ? former[parameter.field] : parameter.default;
  const off = Boolean(former) && value === undefined;
  switch (parameter.type) {
    case "choice":
      return choicePart(parameter, value ?? parameter.default);
    case "boolean":
      return booleanPart(parameter, value ?? parameter.default);
    case "interval":
      return intervalPart(parameter, value);
    case "group":
      return groupPart(parameter, versions, value);
    case "text":
      return textPart(parameter, value);
    case "version":
      return versionPart(parameter, versions[parameter.version_of], value);
    default:
      return parameter.none_allowed ? withNone(parameter, numberPart(parameter, value), off) : numberPart(parameter, value);
  }
}

function numberPart(parameter, value) {
  const { control, read } = numberControl(parameter, value);
  return { element: field(labelOf(parameter), control, hintOf(parameter), parameter.manual), control, read };
}

/** A number as it is typed; what is left as it was keeps all of its digits. */
function numberControl(parameter, value, standing = parameter.default) {
  const shown = value === standing ? "" : typed(parameter, value);
  const control = decimal({ value: shown, placeholder: standing === undefined ? null : typed(parameter, standing) });
  const read = () => {
    if (control.value.trim() === shown) return shown ? value : undefined;
    const entered = numberOf(control, { integer: parameter.type === "integer" });
    if (entered === undefined) return undefined;
    const number = shift(entered, isFraction(parameter) ? -2 : 0);
    if (!isWithin(parameter, number)) {
      control.setAttribute("aria-invalid", "true");
      throw wrong(`${labelOf(parameter)}: ${rangeOf(parameter)}.`);
    }
    return number === standing ? undefined : number;
  };
  return { control, read };
}

function withNone(parameter, { element, control, read }, off) {
  const box = h("input", { type: "checkbox", id: `none-${(count += 1)}`, checked: off });
  const show = () => (control.disabled = box.checked);
  box.addEventListener("change", show);
  show();
  control.after(h("span", { class: "check" }, box, h("label", { for: box.id, class: "check" }, "None")));
  return { element, read: () => (box.checked ? NONE : read()) };
}

function choicePart(parameter, value) {
  const choices = parameter.default === undefined ? [{ value: "", label: `Default: ${parameter.default_text.replaceAll("`", "")}` }, ...parameter.choices] : parameter.choices;
  const control = select(choices.map((each) => [each.value, each.label]), {}, value);
  const read = () => {
    const chosen = choices[control.selectedIndex].value;
    return chosen === parameter.default || chosen === "" ? undefined : chosen;
  };
  return { element: field(parameter.label, control, sentenceOf(parameter), parameter.manual), read };
}

/** A name of a library, or a table from a file, which takes the name's place. */
function textPart(parameter, value = "") {
  const list = h("datalist", { id: `names-${(count += 1)}` }, parameter.suggestions.map((name) => h("option", { value: name })));
  const known = !value.includes("\n");
  let table = known ? undefined : value;
  const control = h("input", { autocomplete: "off", list: list.id, value: known ? value : "", placeholder: known ? null : "Own table" });
  control.addEventListener("input", () => (table = undefined));
  const file = h("input", { type: "file", accept: ".csv,text/csv,text/plain", "aria-label": `${parameter.label}, from a file` });
  file.addEventListener("change", async () => {
    table = await file.files[0]?.text();
    if (table) [control.value, control.placeholder] = ["", file.files[0].name];
  });
  const element = field(parameter.label, control, [sentenceOf(parameter), " Choose a name, or a CSV file.", parameter.default_text ? ` Empty: ${parameter.default_text}.` : ""], parameter.manual);
  control.after(list, file);
  return { element, read: () => control.value.trim() || table || undefined };
}

function booleanPart(parameter, value) {
  const box = h("input", { type: "checkbox", id: `switch-${(count += 1)}`, checked: value, "aria-describedby": `switch-${count}-hint` });
  const element = h("p", { class: "field" },
    h("span", { class: "check" }, box, h("label", { for: box.id, class: "check" }, parameter.label), parameter.manual ? manualLink(parameter.manual, parameter.label) : null),
    h("span", { class: "hint", id: `${box.id}-hint` }, sentenceOf(parameter)),
  );
  return { element, read: () => (box.checked === parameter.default ? undefined : box.checked) };
}

function intervalPart(parameter, value = parameter.default) {
  const bounds = [0, 1].map((place) => numberControl(parameter, value?.[place], parameter.default?.[place]));
  const [low, high] = bounds.map((each) => each.control);
  low.setAttribute("aria-label", `${labelOf(parameter)}, lower end`);
  high.setAttribute("aria-label", `${labelOf(parameter)}, upper end`);
  const read = () => {
    const entered = bounds.map((each, place) => each.read() ?? parameter.default?.[place]);
    if (entered.every((each, place) => each === parameter.default?.[place])) return undefined;
    if (entered.includes(undefined)) throw wrong(`${labelOf(parameter)}: enter both ends.`);
    return entered;
  };
  const element = field(labelOf(parameter), low, hintOf(parameter), parameter.manual);
  low.after(high);
  return { element, read };
}

function groupPart(parameter, versions, value) {
  const { elements, read } = parametersPart(parameter.members, versions, value);
  const body = h("div", { class: "fields" }, elements);
  const box = h("input", { type: "checkbox", id: `group-${(count += 1)}`, checked: value !== undefined, "aria-describedby": `group-${count}-hint` });
  const show = () => (body.hidden = !box.checked);
  box.addEventListener("change", show);
  show();
  const element = h("fieldset", { class: "wide" },
    h("legend", { class: "check" }, box, h("label", { for: box.id, class: "check" }, parameter.label), parameter.manual ? manualLink(parameter.manual, parameter.label) : null),
    h("p", { class: "hint", id: `${box.id}-hint` }, sentenceOf(parameter)),
    body,
  );
  return { element, read: () => (box.checked ? read() : undefined) };
}

/** A version of another method; versions store its content hash, requests name its id. */
function versionPart(parameter, versions, value) {
  const former = value && (versions.find((each) => each.content_sha256 === value)?.id ?? value);
  const options = versions
    .filter((each) => each.state !== "revoked" || each.id === former)
    .map((each) => [each.id, `Version ${each.version}, ${stateWords(each.state)}${each.valid_from ? ` from ${day(each.valid_from)}` : ""}`]);
  const missing = former && !options.some(([id]) => id === former) ? [[former, "A version that is not there"]] : [];
  const none = capital(parameter.default_text || NONE);
  const control = select([["", none], [IN_FORCE, "In force when the frames were taken"], ...options, ...missing], {}, former ?? "");
  return { element: field(parameter.label, control, sentenceOf(parameter), parameter.manual), read: () => control.value || undefined };
}

const labelOf = (parameter) => [parameter.label, unitOf(parameter) && `[${unitOf(parameter)}]`].filter(Boolean).join(" ");

/** Decimal digits moved as text: 1.1 % is 0.011, not 0.011000000000000001. */
function shift(value, places) {
  const [digits, power = "0"] = String(value).split("e");
  return Number(`${digits}e${Number(power) + places}`);
}

const typed = (parameter, value) => (value === undefined ? "" : String(Number(shift(value, isFraction(parameter) ? 2 : 0).toPrecision(6))));

function isWithin({ minimum, maximum, above_minimum: above, below_maximum: below }, value) {
  return !(value < minimum || value > maximum || (above && value === minimum) || (below && value === maximum));
}

function rangeOf(parameter) {
  const { minimum, maximum, above_minimum: above, below_maximum: below } = parameter;
  const [low, high] = [minimum, maximum].map((each) => typed(parameter, each));
  if (low && high && !above && !below) return `between ${low} and ${high}`;
  return [low && `${above ? "above" : "at least"} ${low}`, high && `${below ? "below" : "at most"} ${high}`].filter(Boolean).join(" and ");
}

function hintOf(parameter) {
  const range = rangeOf(parameter);
  const standing = parameter.default === undefined ? parameter.default_text : [parameter.default].flat().map((each) => typed(parameter, each)).join(" to ");
  return [sentenceOf(parameter), range ? ` ${capital(range)}.` : "", standing ? ` Empty: ${standing}.` : ""];
}

const sentenceOf = ({ description }) => prose(description);

const UNITS = { deg: "°", um: "µm" };

/** A fraction is typed and shown in percent; a ratio that may be above 1 is not. */
const isFraction = (parameter) => parameter.unit === "1" && parameter.maximum !== undefined && parameter.maximum <= 1;

const unitOf = (parameter) => (isFraction(parameter) ? "%" : parameter.unit === "1" ? "" : (UNITS[parameter.unit] ?? unit(parameter.unit)));

/** The values of a version's parameters as a list of labels and values; `parameters` are those of its method. */
export function parameterFacts(values, parameters) {
  const known = new Map(parameters.map((each) => [each.field, each]));
  const names = [...known.keys(), ...Object.keys(values).filter((name) => !known.has(name))].filter((name) => values[name] !== null && values[name] !== undefined);
  return h("dl", { class: "facts" }, names.map((name) => [h("dt", {}, known.get(name)?.label ?? words(name)), h("dd", {}, sayValue(values[name], known.get(name)))]));
}

export function sayValue(value, parameter = { unit: "1" }) {
  if (value === undefined || value === null) return "–";
  const written = parameter.unit === "1" ? "" : ` ${unitOf(parameter)}`.replace(" °", "°");
  const one = (each) => (isFraction(parameter) ? percent(each, 6) : `${number(each, 6)}${written}`);
  const chosen = parameter.choices?.find((each) => each.value === value);
  if (chosen) return chosen.label;
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "number") return one(value);
  if (Array.isArray(value)) return value.every((each) => typeof each === "number") ? value.map(one).join(" to ") : value.map((each) => h("div", {}, sayValue(each)));
  if (typeof value === "object") return parameterFacts(value, parameter.members ?? []);
  if (parameter.version_of) return h("code", { title: value }, `${value.slice(0, 16)}…`);
  return value.includes("\n") ? `own table of ${value.trim().split("\n").length} lines` : value;
}
