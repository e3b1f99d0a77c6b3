"""Spectral mismatch: lamps, camera responses, and the factor between shown and true luminance."""
