// Names of measured quantities.

import { words } from "../format.js";
import { methodOf } from "../methods.js";

const REGIONS = {
  request: "the region drawn for this measurement",
  grid: "the outline of the surface with cells",
  frame: "the frame’s own region",
  campaign: "the campaign’s region",
  whole_frame: "the whole frame",
};

/** Name the region that mean, median and range are of. */
export const regionOf = ({ region_origin: origin }) => REGIONS[origin];

/** "luminance", "reflectance, band red", "NDVI". */
export function titleOf(measurement) {
  const { index, radiance } = measurement;
  if (index) return index.name === index.formula ? index.name : index.name.toUpperCase();
  if (radiance) return `radiance, band ${words(radiance)}`;
  const { measured_quantity: quantity, measurement_options: options } = methodOf(measurement.method);
  return options.includes("index") ? `${quantity}, band ${words(measurement.signal)}` : (quantity ?? words(measurement.method));
}
