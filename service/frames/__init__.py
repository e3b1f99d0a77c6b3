"""Frames, their pictures and their image motion."""
