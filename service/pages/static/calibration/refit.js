// Refit of the same campaign without some frames or with another model. The result is another draft.

import { Problem, all, post } from "../api.js";
import { ask } from "../ask.js";
import { parametersFold } from "../campaign/parameters.js";
import { h, leave, toast } from "../dom.js";
import { followJob } from "../live.js";
import { methodOf } from "../methods.js";

/** Ask how, fit, and go to the version that it gives. `chosen`: frames to leave out, id to name. */
export async function fitAnew(calibration, chosen = new Map()) {
  const former = calibration.parameters.exclude ?? [];
  const parameters = parametersFold(methodOf(calibration.method), calibration.camera_id, { former: calibration.parameters, open: !chosen.size });
  const keep = former.map((each, index) => ({ ...each, box: h("input", { type: "checkbox", id: `keep-${index}`, checked: true }) }));
  const said = h("p", { class: "hint", role: "status" });
  const made = await ask({
    title: chosen.size ? `Exclude ${chosen.size === 1 ? [...chosen.values()][0] : `${chosen.size} frames`} and refit` : "Refit",
    body: [
      h("p", { class: "muted" }, "This version does not change. The new one is a draft until it is published."),
      keep.length ? h("fieldset", {}, h("legend", {}, "Excluded so far; untick to include again"), keep.map(({ box, frame, reason }) => h("p", { class: "check" }, box, h("label", { for: box.id, class: "check" }, `${frame}: ${reason}`)))) : null,
      parameters.element,
      said,
    ],
    fields: [
      chosen.size ? { name: "reason", label: "Reason for exclusion", type: "textarea", hint: "What happened when the frame was taken. Recorded with your name.", help: "The new version lists each excluded frame with its reason, and so does every later version that excludes it." } : null,
    ].filter(Boolean),
    submit: "Refit",
    action: async (values) => {
      const kept = keep.filter(({ box }) => box.checked);
      const exclude = [...(await withIds(calibration, kept)), ...[...chosen.keys()].map((frame_id) => ({ frame_id, reason: values.reason }))];
      const body = { ...(await parameters.read()), exclude };
      said.textContent = "Fitting…";
      const job = await followJob((await post(`/v1/campaigns/${calibration.campaign_id}/calibrations`, body)).id, (each) => {
        said.textContent = each.state === "queued" ? "Queued…" : "Fitting…";
      });
      said.textContent = "";
      if (job.state !== "succeeded") throw new Problem(job.error);
      return job.result.calibration_id;
    },
  });
  if (!made) return;
  if (made === calibration.id) toast("This version has the same frames and the same parameters.");
  else await leave(`/calibrations/${made}`);
}

/** Former exclusions name frames as the fit does; the form wants their ids. */
async function withIds(calibration, kept) {
  if (!kept.length) return [];
  const ids = new Map(calibration.points.map((point) => [point.frame, point.frame_id]));
  if (kept.some(({ frame }) => !ids.has(frame))) {
    const hashes = new Map(calibration.inputs.frames.map((each) => [each.sha256, each.frame]));
    for (const each of await all(`/v1/campaigns/${calibration.campaign_id}/frames`)) ids.set(hashes.get(each.sha256), each.id);
  }
  return kept.map(({ frame, reason }) => ({ frame_id: ids.get(frame), reason }));
}
