"""Cameras, meters and panels."""
