// A campaign's name: its project number, or what it is and when it was begun.

import { day } from "../format.js";
import { kindOf } from "../methods.js";

export const titleOf = (campaign) => campaign.project_number ?? `${kindOf(campaign)}, ${day(campaign.created_at)}`;

/** Of one that is known by its id. */
export function nameOf(campaigns, id) {
  const found = campaigns.find((each) => each.id === id);
  return found ? titleOf(found) : "a campaign";
}
