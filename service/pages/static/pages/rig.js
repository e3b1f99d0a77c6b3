// One rig: its cameras, their orientation with uncertainties, residuals, repeats and drift.

import { get } from "../api.js";
import { byId, empty, filename, fill, h, load, shorten, table } from "../dom.js";
import { drawFindings } from "../causes.js";
import { capital, counted, fixed, inOrder, number, quantity, tag, time } from "../format.js";

const { rigId, given } = document.querySelector("main").dataset;
const cameras = [...document.querySelectorAll("[data-camera-id]")].map((each) => ({ id: each.dataset.cameraId, serial: each.dataset.serial, name: each.textContent }));
const VERDICTS = { stable: "good", drifts: "bad", cannot_tell: "" };
const POSE = [...["yaw", "pitch", "roll", "boresight"].map((name) => [name, capital(name), "°"]), ...["x", "y", "z"].map((name) => [name, name, "m"])];
const limits = { tolerance_deg: [byId("tolerance-deg"), 1], tolerance_m: [byId("tolerance-mm"), 0.001] };

const ask = () => {
  const query = new URLSearchParams(given);
  for (const [name, [input, scale]] of Object.entries(limits)) if (Number(input.value) > 0) query.set(name, Number(input.value) * scale);
  return get(`/v1/rigs/${rigId}/orientation?${query}`);
};
const answer = ask();
const newest = answer.then(({ sets }) => sets.at(-1));
const versions = newest.then((set) => Promise.all((set?.calibration_ids ?? []).map((id) => get(`/v1/calibrations/${id}`))));

load(byId("cameras"), () => versions, (found) => {
  byId("exports").hidden = !found.length;
  if (found.some((each) => each.state === "draft")) {
    fill(byId("said"), h("p", { class: "note warn" }, "Made from drafts, as the address names them: publish the versions of all cameras, and this is the rig’s orientation."));
  }
  const columns = [
    { head: "Camera", header: true, cell: ({ id, name, serial }) => h("span", {}, h("a", { href: `/cameras/${id}` }, name), h("br"), h("span", { class: "mono small muted" }, serial)) },
    { head: "Role", cell: (camera) => (camera === cameras[0] ? "reference" : "") },
    { head: "Version", cell: (camera) => versionOf(found.find((each) => each.camera_id === camera.id)) },
  ];
  return table(columns, cameras, { caption: "Cameras of the rig", stack: true });
});

load(byId("orientation"), () => newest, (set) => {
  if (!set) return empty("Not oriented yet", "Photograph one board with all cameras at once, three times or more, in a campaign of each camera, and publish the versions.", h("a", { class: "button", href: "/campaigns" }, "Campaigns"));
  const { poses, ...fit } = set.orientation;
  const columns = [{ head: "Camera", header: true, cell: (pose) => h("span", { class: "mono" }, pose.camera) }, ...POSE.map(([name, head, unit]) => ({ head: `${head} [${unit}]`, class: "number", cell: (pose) => quantity({ ...pose[name], unit: "1" }) }))];
  return [
    table(columns, poses, { caption: "Orientation of each camera against the reference", stack: true }),
    h("p", { class: "small muted" }, `${counted(fit.triggers, "trigger")}, ${number(fit.corners, 7)} corners. From trigger to trigger the orientation scatters by ${number(fit.scatter_deg, 2)}° and ${number(fit.scatter_mm, 2)} mm beyond the corners, which scatter ${number(fit.corner_scatter_rel, 3)} times as in the cameras’ own calibrations.`),
  ];
});

load(byId("flags"), async () => (await newest)?.findings ?? [], drawFindings);

const drawStability = (asked) => load(byId("stability"), () => asked, ({ stability }) => {
  if (!stability.length) return empty("No repeats yet", "Each set of campaigns is one determination; the drift is judged from the third.");
  const columns = [
    { head: "Quantity", header: true, cell: (row) => h("span", {}, row.name, h("span", { class: "muted mono small" }, ` ${row.camera}`)) },
    { head: "Verdict", cell: (row) => tag(row.verdict, VERDICTS[row.verdict]) },
    { head: "Mean", class: "number", cell: (row) => quantity(row.mean) },
    { head: "Repeatability", class: "number", cell: (row) => quantity(row.repeatability) },
    { head: "Change", class: "number", cell: (row) => quantity(row.change) },
    { head: "Trend", class: "number", cell: (row) => quantity(row.slope) },
    { head: "Sets", class: "number", cell: (row) => number(row.sets) },
    { head: "Explanation", class: "words", cell: (row) => row.said },
  ];
  return table(columns, stability, { caption: "Stability of the orientation over the sets", stack: true });
});
drawStability(answer);
for (const [input] of Object.values(limits)) input.addEventListener("change", () => input.reportValidity() && drawStability(ask()));

load(byId("pictures"), () => newest, (set) => {
  if (!set) return null;
  const columns = [
    { head: "Frame", header: true, class: "frame-name", cell: (point) => filename(point.frame) },
    { head: "Status", cell: (point) => (point.used ? tag("used", "good") : h("span", {}, tag("not used", "warn"), h("span", { class: "small" }, ` ${point.left_out}`))) },
    { head: "Camera", cell: (point) => h("span", { class: "mono" }, point.camera) },
    { head: "Trigger", cell: (point) => point.trigger },
    { head: "Residual [px]", class: "number", cell: (point) => fixed(point.rms_px, 3) },
  ];
  return shorten(inOrder(set.orientation.points, (point) => point.frame), (points) => table(columns, points, { caption: "Pictures of the newest set", stack: true }), 12);
});

load(byId("sets"), () => answer, ({ sets, left_out: out }) => {
  const columns = [
    { head: "Time", header: true, cell: (set) => time(set.at) },
    { head: "Triggers", class: "number", cell: (set) => number(set.orientation.triggers) },
    { head: "Flags", cell: (set) => (set.orientation.flags.length ? tag(counted(set.orientation.flags.length, "flag"), "warn") : h("span", { class: "muted" }, "none")) },
    { head: "Versions", cell: (set) => h("span", {}, set.calibration_ids.map((id, place) => [place ? ", " : "", h("a", { href: `/calibrations/${id}` }, cameras[place].serial)])) },
  ];
  return [
    sets.length ? table(columns, [...sets].reverse(), { caption: "Sets, the newest first", stack: true }) : empty("No sets yet", "No published versions share triggers."),
    out.length ? [h("h3", {}, "Versions that did not count"), h("ul", {}, out.map((each) => h("li", {}, h("a", { href: `/calibrations/${each.calibration_id}` }, "a version"), `: ${each.why}`)))] : null,
  ];
});

const versionOf = (version) => (version ? h("span", {}, h("a", { href: `/calibrations/${version.id}` }, `version ${version.version}`), " ", tag(version.state)) : h("span", { class: "muted" }, "none"));
