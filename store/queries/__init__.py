"""Queries of the tables, by subject."""
