"""The parts of the vignetting calibration; `radiometry.methods.vignetting` is its door."""
