// Failures by cause: retried or dismissed all at once.

import { post } from "../api.js";
import { causeList, small } from "../causes.js";
import { may, toast } from "../dom.js";
import { counted } from "../format.js";
import { act, empty } from "../states.js";
import { done } from "../undo.js";
import { jobCause } from "./cause.js";

const SCOPES = { extract: "upload", fit: "calibrate", measure: "upload" };

/** The causes as lines; `changed` is called after each press that changed something. */
export function listFailures(causes, works, changed) {
  if (!causes.length) return empty("No failed jobs", "Jobs that fail are listed here with their reason.");
  return causeList(causes.map((cause) => {
    const line = jobCause(cause, works);
    return { ...line, actions: may(SCOPES[cause.newest.kind]) ? [...line.actions, ...buttons(cause, line.title, changed)] : line.actions };
  }));
}

function buttons({ newest: { state, kind, error, campaign_id } }, title, changed) {
  const chosen = { state, kind, ...(error ? { code: error.code } : {}), ...(campaign_id ? { campaign_id } : {}) };
  const dismiss = (dismissed) => post("/v1/jobs/dismiss", { ...chosen, dismissed });
  const retry = small("Retry", () => act(retry, async () => {
    const { retried } = await post("/v1/jobs/retry", chosen);
    toast(`Retrying ${counted(retried, "job")}.`);
    await changed();
  }), { "aria-label": `Retry: ${title}` });
  const away = small("Dismiss", () => act(away, async () => {
    await dismiss(true);
    done("Dismissed.", async () => {
      await dismiss(false);
      await changed();
    });
    await changed();
  }), { quiet: true, "aria-label": `Dismiss: ${title}` });
  return [retry, away];
}
