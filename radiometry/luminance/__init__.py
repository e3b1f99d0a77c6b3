"""The parts of the luminance calibration; `radiometry.luminance.method` is its door."""
