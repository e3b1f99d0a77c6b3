"""Models, least squares and evidence that the methods share."""
