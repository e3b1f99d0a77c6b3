"""Fits, versions, what is decided of them, and the methods."""
