// The fit: its parameters, its progress, and the resulting versions.

import { all, patch, post } from "../api.js";
import { fill, h, leave, may, table } from "../dom.js";
import { ago, counted, number, quantity, tag } from "../format.js";
import { followJob } from "../live.js";
import { coefficientLabel, headlineOf } from "../methods.js";
import { act, empty, load } from "../states.js";
import { readinessOf } from "./missing.js";
import { parametersFold, statedPart, withManual } from "./parameters.js";

export function calibrateSection(state) {
  const versions = h("div");
  const show = () => load(versions, () => all(`${state.path}/calibrations`), (found) => ((state.fitted = found), state.tell("fitted"), found.length ? list(found) : empty("No versions yet", "Every fit makes a version of the camera’s calibration, which is a draft until it is published.")));
  show();
  return h("div", { class: "columns calibrate" }, may("calibrate") ? starter(state, show) : null, versions);
}

/** "Fit K" of a method whose first coefficient is a K. */
const fitLabel = ({ name }) => (coefficientLabel(name, headlineOf(name)).endsWith(" K") ? "Fit K" : "Fit");

function starter(state, show) {
  const parameters = parametersFold(state.method, state.campaign.camera_id);
  const given = state.method.parameters.filter((each) => each.given_by === "campaign");
  const stated = statedPart(withManual(given, state.method), Object.fromEntries(given.map((each) => [each.field, state.campaign[each.name]])));
  const progress = h("div", { role: "status" });
  const lacking = h("div");
  const button = h("button", { class: "primary", type: "submit" }, fitLabel(state.method));
  const draw = () => {
    const { count, said } = readinessOf(state.campaign, state.sending);
    fill(lacking, h("p", { class: "muted small" }, count ? h("a", { href: "#before" }, `${counted(count, "thing")} needed before the fit`) : said === "ready" ? "Nothing is missing." : "Frames are on their way."));
  };
  for (const name of ["campaign", "sending"]) state.on(name, draw);
  draw();
  const start = async () => {
    fill(progress);
    const changed = Object.entries(stated.read()).filter(([name, value]) => value !== state.campaign[name]);
    if (changed.length) state.campaign = await patch(state.path, Object.fromEntries(changed));
    const begun = await post(`${state.path}/calibrations`, await parameters.read()).catch((error) => {
      if (error.code === "campaign_incomplete") state.touch();
      throw error;
    });
    const bar = h("progress", { max: 1, value: 0, "aria-label": "The fit" });
    const told = h("p", { class: "muted small" }, "Queued");
    fill(progress, bar, told);
    const job = await followJob(begun.id, (each) => {
      bar.value = each.progress;
      told.textContent = { queued: "Queued", running: "Fitting" }[each.state] ?? "";
    });
    if (job.state === "succeeded") await leave(`/calibrations/${job.result.calibration_id}`);
    fill(progress, h("div", { class: "note bad" }, h("strong", {}, job.error.title), h("p", {}, job.error.detail)));
    await show();
    state.tell("versions");
  };
  return h(
    "form",
    { class: "card", onsubmit: (event) => (event.preventDefault(), act(button, start)) },
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
    const of = [coefficient.iso && `ISO ${number(coefficient.iso, 6)}`, coefficient.f_number && `f/${number(coefficient.f_number, 3)}`, coefficient.band, coefficient.channel].filter(Boolean);
    return [quantity(coefficient), h("span", { class: "sub" }, [coefficientLabel(version.method, coefficient.name), ...of, more.length ? `and ${more.length} more` : ""].filter(Boolean).join(" · "))];
  };
  return table(
    [
      { head: "Version", header: true, class: "nowrap", cell: (each) => h("a", { href: `/calibrations/${each.id}` }, `Version ${each.version}`) },
      { head: "State", cell: (each) => tag(each.state) },
      { head: "Result", cell: first },
      { head: "Flags", cell: (each) => number(new Set(each.coefficients.flatMap((c) => c.flags)).size) },
      { head: "Created", class: "nowrap", cell: (each) => h("time", { datetime: each.created_at, title: each.created_at }, ago(each.created_at)) },
    ],
    found,
    { caption: "Versions fitted from this campaign" },
  );
}
