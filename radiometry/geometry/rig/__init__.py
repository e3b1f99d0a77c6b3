"""Relative orientation of the cameras of a rig, from pictures of one board taken together."""
