import { all, get, post } from "../api.js";
import { boxes, field } from "../ask.js";
import { act, byId, empty, fill, h, load, table } from "../dom.js";
import { cameraName, capital, counted, groupBy, inOrder, number, quantity, tag } from "../format.js";
import { METHODS, coefficientLabel, labelOf, methodOf, named, readTolerance } from "../methods.js";
import { plot } from "../plots.js";

const VERDICTS = { shared: ["one set for all", "good"], per_camera: ["one set per camera", "warn"], cannot_tell: ["inconclusive", ""] };
const wanted = new URLSearchParams(location.search).get("model");

load(byId("fleet-form"), () => Promise.all([all("/v1/cameras"), get("/v1/series/coefficients")]), ([cameras, { rows }]) => {
  const comparable = [...groupBy(inOrder(cameras, cameraName), modelOf)].filter(([, members]) => members.length > 1);
  if (!comparable.length) {
    return empty("Nothing to compare yet", "Two cameras of one model are needed, preferably with three campaigns each.", h("a", { class: "button", href: "/cameras" }, "Cameras"));
  }
  return form(comparable, rows);
});

function form(models, rows) {
  const versions = (camera, method) => new Set(rows.filter((row) => row.camera_id === camera.id && row.method === method).map((row) => row.calibration_id)).size;
  const model = h("select", { id: "model" }, models.map(([name]) => h("option", { selected: name === wanted }, name)));
  const method = h("select", { id: "method" }, METHODS.map((each) => h("option", { value: each.name }, each.label)));
  const said = h("p", { class: "small muted" });
  const offerMethod = () => {
    const [, cameras] = models.find(([name]) => name === model.value);
    const known = (name) => cameras.filter((camera) => versions(camera, name)).length;
    method.value = METHODS.map((each) => each.name).reduce((best, name) => (known(name) > known(best) ? name : best));
    choose();
  };
  const members = h("div", { class: "members" });
  const tolerance = h("input", { id: "tolerance", type: "number", step: "any", min: "0", required: true, value: "4" });
  const unit = h("span", {});
  const button = h("button", { type: "submit", class: "primary" }, "Compare");
  const choose = () => {
    const [, cameras] = models.find(([name]) => name === model.value);
    unit.textContent = methodOf(method.value).tolerance_unit;
    fill(members, cameras.map((camera) => h("label", { class: "check" },
      h("input", { type: "checkbox", name: "camera", value: camera.id, checked: versions(camera, method.value) > 0, disabled: !versions(camera, method.value) }),
      h("span", {}, h("span", { class: "mono" }, camera.serial), h("span", { class: "muted" }, ` ${counted(versions(camera, method.value), "version")}`)),
    )));
    const able = cameras.filter((camera) => versions(camera, method.value)).length;
    button.disabled = able < 2;
    said.textContent = able < 2 ? `${counted(able, "camera")} of this model ${able === 1 ? "has" : "have"} a published ${labelOf(method.value)} version; two are needed.` : "";
  };
  model.addEventListener("change", offerMethod);
  method.addEventListener("change", choose);
  offerMethod();
  return h("form", { class: "card", oninput: () => fill(byId("fleet-answer")), onsubmit: (event) => (event.preventDefault(), judge(event.target, button, method.value, tolerance)) },
    h("div", { class: "fields" },
      field("Model", model, null, "/docs/fleet#repeats"),
      field("Method", method, null, "/docs/fleet#the-model"),
      field(["Accepted deviation from the shared value [", unit, "]"], tolerance, null, "/docs/fleet#tolerance-and-cost"),
    ),
    boxes("Cameras", "Those without a published version of the method cannot be compared.", members, said),
    h("div", { class: "actions" }, button),
  );
}

const judge = (form, button, method, tolerance) => act(button, async () => {
  const answer = await post("/v1/fleet/verdict", {
    method,
    camera_ids: new FormData(form).getAll("camera"),
    tolerance: readTolerance(method, tolerance.value),
  });
  const place = h("div", { class: "plot", role: "region", "aria-label": "Coefficients of each camera", tabindex: "0" });
  fill(byId("fleet-answer"), shown(answer, place));
  await plot(place, `/plots/fleet?${new URLSearchParams([["method", method], ...new FormData(form).getAll("camera").map((id) => ["camera_id", id])])}`);
});

function shown(answer, place) {
  const [word, kind] = VERDICTS[answer.verdict];
  const columns = [
    { head: "Coefficient", header: true, cell: (row) => named(row, answer.method) },
    { head: "Verdict", cell: (row) => tag(...VERDICTS[row.verdict]) },
    { head: "Shared value", class: "number", cell: (row) => quantity(row.mean) },
    { head: "Cost of sharing", class: "number", cell: (row) => quantity(row.cost) },
    { head: "Most affected", cell: (row) => (row.costliest ? h("span", { class: "mono" }, row.costliest) : "–") },
    { head: "Repeats", class: "number", cell: (row) => number(row.repeats) },
    { head: "Explanation", class: "words", cell: (row) => capital(row.said.replace(/^[a-z0-9_]+(?: at [^:]+)?: /, "")) },
  ];
  return [
    h("div", { class: "section-head" }, h("h2", {}, "Verdict "), tag(word, kind)),
    h("p", { class: `note ${kind}` }, answer.parameters.reduce((said, { name }) => said.replace(new RegExp(`\\b${name}\\b`, "g"), coefficientLabel(answer.method, name)), answer.said)),
    place,
    answer.parameters.length ? table(columns, answer.parameters, { caption: "Verdict for each coefficient", stack: true }) : null,
    answer.left_out.length ? [h("h3", {}, "Versions that did not count"), h("ul", {}, answer.left_out.map((each) => h("li", {}, h("a", { href: `/calibrations/${each.calibration_id}` }, "a version"), `: ${each.why}`)))] : null,
    h("details", {}, h("summary", {}, "Assumptions"), h("ul", { class: "small muted" }, (answer.assumed ?? []).map((each) => h("li", {}, each)))),
  ];
}

const modelOf = (camera) => `${camera.make} ${camera.model}`;
