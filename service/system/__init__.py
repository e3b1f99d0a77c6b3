"""Health, metrics and the published document."""
