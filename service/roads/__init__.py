"""Roads: site, control points, evaluations, and their papers."""
