"""Readings of a finished map of any quantity: profiles along lines, isolines and histograms."""
