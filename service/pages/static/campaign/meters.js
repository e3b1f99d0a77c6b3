// A meter with its certificate, registered where it is needed.

import { post } from "../api.js";
import { ask } from "../ask.js";
import { wrong } from "../states.js";
import { readNumber } from "./forms.js";

export const nameOfMeter = (meter) => meter && `${meter.make} ${meter.model} ${meter.serial}`;

/** Ask for a meter, or for the next certificate of one; answers it as it was registered, or undefined. */
export const askForMeter = (meter = {}) =>
  ask({
    title: meter.id ? "Add a certificate" : "Register a meter",
    fields: [
      { name: "kind", label: "Kind", of: "NewMeter", options: [["luminance", "Luminance meter"], ["illuminance", "Illuminance meter"], ["sunshine", "Sunshine sensor"]], value: meter.kind },
      { name: "make", label: "Make", of: "NewMeter", value: meter.make },
      { name: "model", label: "Model", of: "NewMeter", value: meter.model },
      { name: "serial", label: "Serial number", of: "NewMeter", value: meter.serial },
      { name: "number", label: "Certificate number", of: ["Certificate", "number"], required: false },
      { name: "laboratory", label: "Laboratory", of: ["Certificate", "laboratory"], required: false },
      { name: "issued_on", label: "Issued on", of: ["Certificate", "issued_on"], type: "date", required: false },
      { name: "due_on", label: "Due on", of: ["Certificate", "due_on"], type: "date", required: false },
      { name: "uncertainty", label: "Expanded uncertainty [%]", of: ["Certificate", "expanded_uncertainty_rel"], required: false },
      { name: "coverage", label: "Coverage factor", of: ["Certificate", "coverage_factor"], value: "2", required: false },
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
