"""Real camera files, which lie beside the project and are never part of it."""

import os
from pathlib import Path

import pytest

FOLDER = Path(os.environ.get("STILB_TEST_DATA", Path(__file__).parents[3] / "shared" / "data"))


def data_file(name: str) -> Path:
    """One of them; the test that asks is skipped where it is absent."""
    path = FOLDER / name
    if not path.exists():
        absent = path if FOLDER.is_dir() else FOLDER
        pytest.skip(f"no real data: {absent} does not exist (set STILB_TEST_DATA)")
    return path
