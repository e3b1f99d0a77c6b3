"""The versions that a result names: they rise when the same input may give another figure."""

CODE_VERSION = "0.1.2"
"""Of the fit. Part of a version's content hash."""

MEASURER = "measure-1"
"""Of a measurement and its map. Part of a measurement's content hash."""

EXTRACTOR = "extract-1"
"""Of the decoder and the statistics. Part of an extraction's key."""
