// One measurement, from its request to its page.

import { leave, post, Problem } from "../api.js";
import { followJob } from "../live.js";

/** Measure and go there; `progress` tells how far it is. */
export async function measureOne(body, progress) {
  try {
    progress.textContent = "Asking…";
    const started = await post("/v1/measurements", body);
    const job = await followJob(started.id, (each) => (progress.textContent = each.state === "queued" ? "Queued…" : `Measuring, ${Math.round(100 * each.progress)} %`));
    if (job.state !== "succeeded") throw new Problem(job.error);
    await leave(`/measurements/${job.result.measurement_id}`);
  } finally {
    progress.textContent = "";
  }
}
