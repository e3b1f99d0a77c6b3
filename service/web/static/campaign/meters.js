// A meter with its certificate, registered where it is needed.

import { post } from "../api.js";
import { ask } from "../ask.js";
import { readNumber, wrong } from "./numbers.js";

export const nameOfMeter = (meter) => meter && `${meter.make} ${meter.model} ${meter.serial}`;

/** Ask for a meter, or for the next certificate of one; answers it as it was registered, or undefined. */
export const askForMeter = (meter = {}) =>
  ask({
    title: meter.id ? "Add a certificate" : "Register a meter",
    fields: [
      { name: "kind", label: "Kind", options: [["luminance", "Luminance meter"], ["illuminance", "Illuminance meter"], ["sunshine", "Sunshine sensor"]], value: meter.kind },
      { name: "make", label: "Make", value: meter.make },
      { name: "model", label: "Model", value: meter.model },
      { name: "serial", label: "Serial number", value: meter.serial },
      { name: "number", label: "Certificate number", required: false, hint: "Without a certificate, u(K) does not include the meter’s calibration, and K is flagged." },
      { name: "laboratory", label: "Laboratory", required: false },
      { name: "issued_on", label: "Issued on", type: "date", required: false },
      { name: "due_on", label: "Due on", type: "date", required: false },
      { name: "uncertainty", label: "Expanded uncertainty [%]", required: false },
      { name: "coverage", label: "Coverage factor", value: "2", required: false },
    ],
    submit: meter.id ? "Add" : "Register",
    action: ({ kind, make, model, serial, ...rest }) => post("/v1/meters", { kind, make, model, serial, ...certificateOf(rest) }),
  });

function certificateOf({ number, laboratory, issued_on, due_on, uncertainty, coverage }) {
  if (!number && !laboratory && !issued_on && !uncertainty) return {};
  if (!number || !laboratory || !issued_on || !due_on || !uncertainty || !coverage) throw wrong("Enter number, laboratory, both dates, uncertainty and coverage factor of the certificate, or leave all of them empty.");
  const [percent, factor] = [readNumber(uncertainty), readNumber(coverage)];
  if (!(percent > 0 && percent < 100) || !(factor >= 1)) throw wrong("The uncertainty is a percentage such as 2, the coverage factor a number such as 2.");
  return { certificate: { number, laboratory, issued_on, due_on, expanded_uncertainty_rel: percent / 100, coverage_factor: factor } };
}
