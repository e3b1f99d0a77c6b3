"""Campaigns with their readings, tables, checklist, grid, manifests and proposals."""
