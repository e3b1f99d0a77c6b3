"""Coefficients in force, and series for dashboards."""
