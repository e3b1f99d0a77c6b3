"""Measuring a frame, one file a method; what they share is in `task`."""
