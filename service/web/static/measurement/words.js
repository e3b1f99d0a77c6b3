// Names of measured quantities.

import { words } from "../format.js";

/** "luminance", "reflectance, band red", "NDVI". */
export function titleOf(measurement) {
  if (measurement.index) return measurement.index.name.toUpperCase();
  return measurement.method === "reflectance" ? `reflectance, band ${words(measurement.signal)}` : words(measurement.method);
}
