// How certificates name the organisation, and what it stores.

import { get, patch } from "../api.js";
import { ask } from "../ask.js";
import { byId, figure, h, load, may } from "../dom.js";
import { bytes, day, number, percent } from "../format.js";

const organisation = () => get("/v1/organisation");

const show = () => load(byId("details"), organisation, (found) => {
  const facts = [
    ["Name on certificates", found.name],
    ["Address on certificates", found.address ?? h("span", { class: "muted" }, "Not given")],
    ["Time zone", found.time_zone ?? h("span", { class: "muted" }, "Not given")],
    ["Incomplete certificates", found.refuses_incomplete_certificates ? "are not published" : "are published with their gaps named"],
    ["Registered", day(found.created_at)],
  ];
  return h("dl", { class: "facts card" }, facts.map(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
});

load(byId("storage"), organisation, ({ usage }) => h("dl", { class: "figures" },
  used("Files", bytes(usage.stored_bytes), usage.stored_bytes, usage.stored_bytes_limit, bytes),
  used("Frames", number(usage.frames, 7), usage.frames, usage.frames_limit, (limit) => number(limit, 7)),
  used("Jobs waiting", number(usage.jobs_waiting, 7), usage.jobs_waiting, usage.jobs_waiting_limit, (limit) => number(limit, 7)),
  used("Requests in this minute", number(usage.requests_in_minute, 7), usage.requests_in_minute, usage.requests_in_minute_limit, (limit) => number(limit, 7)),
));

const used = (name, text, count, limit, say) => figure(name, text, limit ? `${percent(count / limit)} of ${say(limit)}` : "no limit");

byId("edit").hidden = !may("admin");
byId("edit").addEventListener("click", async () => {
  const found = await organisation();
  const changed = await ask({
    title: "Edit details",
    fields: [
      { name: "name", label: "Name on certificates", of: "OrganisationChange", value: found.name, maxlength: 200 },
      { name: "address", label: "Address on certificates", of: "OrganisationChange", type: "textarea", value: found.address ?? "", required: false },
      { name: "time_zone", label: "Time zone", of: "OrganisationChange", value: found.time_zone ?? "", required: false },
      { name: "refuses", label: "Incomplete certificates", of: ["OrganisationChange", "refuses_incomplete_certificates"], options: [["no", "Publish, with their gaps named"], ["yes", "Do not publish"]], value: found.refuses_incomplete_certificates ? "yes" : "no", hint: "A certificate is complete if it has what ISO/IEC 17025 asks for." },
    ],
    submit: "Save",
    action: ({ name, address, time_zone, refuses }) => patch("/v1/organisation", { name, address: address ?? "", time_zone: time_zone ?? "", refuses_incomplete_certificates: refuses === "yes" }),
  });
  if (changed) show();
});

show();
