"""Version of the product, of its schema, and of computations that may give another figure."""

import sqlite3
from contextlib import closing
from functools import cache
from pathlib import Path

FIT_CODE_VERSION = "0.1.21"
"""Fit code version: `software.stilb` of a calibration version, and part of its content hash.

It is not the version of the product: a release that fits as before keeps it, and with it every stored hash.
"""

MEASURER = "measure-13"  # of a measurement and its map. Part of a measurement's content hash

EXTRACTOR = "extract-5"  # of the decoder and the statistics. Part of an extraction's key


RENDERER = "render-4"  # of the layout of certificates, reports, plots; those of another are rendered again


@cache
def read_version() -> str:
    """Return the version of the product: in `pyproject.toml` of a checkout, else of the installed package."""
    # 2 MB, which the launcher does without
    import tomllib  # noqa: PLC0415
    from importlib import metadata  # noqa: PLC0415

    path = Path(__file__).parents[1] / "pyproject.toml"
    if path.is_file():
        return str(tomllib.loads(path.read_text(encoding="utf-8"))["project"]["version"])
    return metadata.version("stilb-server")


MIGRATIONS = Path(__file__).parent.parent / "migrations"


@cache
def list_revisions() -> list[str]:
    """Return the revisions in their order: migrations are numbered, and their files begin with the number."""
    return sorted(path.name.partition("_")[0] for path in (MIGRATIONS / "versions").glob("[0-9]*.py"))


def own_schema() -> str:
    return list_revisions()[-1]


def is_current(url: str) -> bool:
    """Return True if an SQLite database is known to have this code's schema; False for any other."""
    scheme, _, path = url.partition(":///")
    if scheme != "sqlite" or not Path(path).is_file():
        return False
    try:
        with closing(sqlite3.connect(path, timeout=1.0)) as connection:
            return connection.execute("SELECT version_num FROM alembic_version").fetchall() == [
                (own_schema(),)
            ]
    except sqlite3.Error:
        return False
