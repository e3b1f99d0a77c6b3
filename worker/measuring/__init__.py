"""Measuring a frame, one file for each class of application; what they share is in `task`."""
