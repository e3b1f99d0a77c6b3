// Names of measured quantities.

import { words } from "../format.js";
import { methodOf } from "../methods.js";

/** "luminance", "reflectance, band red", "NDVI". */
export function titleOf(measurement) {
  if (measurement.index) return measurement.index.name.toUpperCase();
  const { measured_quantity: quantity, measurement_options: options } = methodOf(measurement.method);
  return options.includes("index") ? `${quantity}, band ${words(measurement.signal)}` : (quantity ?? words(measurement.method));
}
