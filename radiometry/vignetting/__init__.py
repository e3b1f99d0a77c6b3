"""The parts of the vignetting calibration; `radiometry.vignetting.method` is its door."""
