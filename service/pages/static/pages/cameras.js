import { all, get } from "../api.js";
import { byId, empty, h, load, may, table, toast } from "../dom.js";
import { ago, cameraName, counted, day, inOrder, tag } from "../format.js";
import { headlines, inForce, labelOf } from "../methods.js";
import { registerCamera } from "./camera-edit.js";

const region = byId("cameras");
const add = byId("add-camera");
add.hidden = !may("calibrate");
add.addEventListener("click", register);

const show = () => load(region, () => Promise.all([all("/v1/cameras"), get("/v1/series/coefficients")]), ([cameras, { rows }]) => {
  if (!cameras.length) {
    const button = may("calibrate") ? h("button", { type: "button", class: "primary", onclick: register }, "Register a camera") : null;
    return empty("No cameras yet", "Register a camera body with the make and model that it writes into its files.", button);
  }
  return table(columns, inOrder(cameras, cameraName).flatMap((camera) => linesOf(camera, rows)), { caption: "Cameras and their calibrations in force", stack: true });
});

const columns = [
  { head: "Camera", header: true, cell: ({ camera, first }) => (first ? linkTo(camera) : h("span", { class: "hidden" }, `${camera.model} ${camera.serial}`)) },
  { head: "In force", cell: ({ held }) => (held ? labelOf(held.method) : tag("none", "warn")) },
  { head: "Version", class: "number", cell: ({ held }) => (held ? h("a", { href: `/calibrations/${held.calibration_id}` }, String(held.version)) : "") },
  { head: "Since", cell: ({ held }) => (held ? h("span", { class: "nowrap" }, day(held.valid_from), h("span", { class: "muted" }, ` ${ago(held.valid_from)}`)) : "") },
  { head: "Coefficient ± U (95 %)", cell: ({ held }) => (held ? headlines(held) : "") },
  { head: "Flags", cell: ({ held }) => (held?.flags.length ? tag(counted(held.flags.length, "flag"), "warn") : held ? h("span", { class: "muted" }, "none") : "") },
];

const linkTo = ({ id, make, model, serial }) => h("span", {}, h("a", { href: `/cameras/${id}` }, `${make} ${model}`), h("br"), h("span", { class: "mono small muted" }, serial));

/** A camera's lines: one a version in force, or one that says that there is none. */
function linesOf(camera, rows) {
  const held = inForce(rows.filter((row) => row.camera_id === camera.id));
  return (held.length ? held : [undefined]).map((each, place) => ({ camera, held: each, first: place === 0 }));
}

async function register() {
  const camera = await registerCamera();
  if (camera === undefined) return;
  toast(`${camera.make} ${camera.model} is registered.`);
  show();
}

show();
