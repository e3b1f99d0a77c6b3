"""Measurements with a calibrated camera, their maps and lists."""
