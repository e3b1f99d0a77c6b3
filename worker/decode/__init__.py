"""Decoding of a raw file to a frame, in a process of its own: hostile bytes end here."""
