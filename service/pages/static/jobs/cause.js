// One cause of failed jobs in words, the same on the first page and on the page of jobs.

import { smallLink } from "../causes.js";
import { nameOf } from "../campaign/named.js";
import { counted } from "../format.js";

/** A cause of `GET /v1/jobs/causes` as a line; `works`: the campaigns by name. */
export function jobCause({ count, newest: { kind, state, error, campaign_id: id, filename } }, works) {
  // of a fit that failed the title says no more
  const why = kind === "extract" && error?.title ? `: ${error.title.charAt(0).toLowerCase()}${error.title.slice(1)}`.replace(/\.$/, "") : "";
  const what = kind === "fit" ? (count > 1 ? `${count} fits failed` : "A fit failed") : kind === "extract" ? `${counted(count, "frame")} refused` : `${counted(count, "measurement")} failed`;
  const about = [id && nameOf(works, id), filename && (count > 1 ? `${filename} and ${count - 1} more` : filename)].filter(Boolean).join(", ");
  return {
    mark: "bad",
    title: `${what}${why}`,
    where: [about, error?.detail].filter(Boolean).join(": ") + (state === "quarantined" ? " Stopped after 3 attempts." : ""),
    actions: [id ? smallLink(filename ? "Show frames" : "Show campaign", `/campaigns/${id}${filename ? "#frames" : ""}`) : smallLink("Show jobs", "/jobs")],
  };
}
