"""Comparison of the cameras of a model, and the drift of one camera."""
