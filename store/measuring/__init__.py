"""Measurements: the plan of one (plan), the version it uses (version), what is kept of it (record)."""
