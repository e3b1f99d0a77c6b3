"""Luminance maps: a TIFF to measure in, and a picture to look at, in one pass over the frame."""
