"""The parts of the reflectance calibration; `radiometry.methods.reflectance` is its door."""
