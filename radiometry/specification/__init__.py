"""Specification of a calibration method and description of its parameters."""
