"""Sharpness: the response to slanted edges and Siemens stars, in cycles per pixel."""
