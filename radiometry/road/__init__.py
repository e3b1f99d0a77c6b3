"""Roads: illuminance on the grid of a standard, from frames and control points, and the verdict."""
