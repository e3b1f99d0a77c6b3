"""Version of the product, and versions of computations, which rise when an input may give another figure."""

import tomllib
from functools import cache
from importlib import metadata
from pathlib import Path

FIT_CODE_VERSION = "0.1.6"
"""Fit code version: `software.stilb` of a calibration version, and part of its content hash.

It is not the version of the product: a release that fits as before keeps it, and with it every stored hash.
"""

MEASURER = "measure-7"
"""Of a measurement and its map. Part of a measurement's content hash."""

EXTRACTOR = "extract-3"
"""Of the decoder and the statistics. Part of an extraction's key."""


RENDERER = "render-3"
"""Of how certificates, reports and plots are laid out and drawn. A kept file of another is rendered again."""


@cache
def read_version() -> str:
    """Return the version of the product: in `pyproject.toml` of a checkout, else of the installed package."""
    path = Path(__file__).parents[1] / "pyproject.toml"
    if path.is_file():
        return str(tomllib.loads(path.read_text(encoding="utf-8"))["project"]["version"])
    return metadata.version("stilb-server")
