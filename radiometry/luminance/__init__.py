"""The parts of the luminance calibration; `radiometry.methods.luminance` is its door."""
