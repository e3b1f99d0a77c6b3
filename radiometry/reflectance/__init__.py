"""The parts of the reflectance calibration; `radiometry.reflectance.method` is its door."""
