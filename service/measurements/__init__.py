"""Measurements with a calibrated camera, their maps, and both for other programs."""
