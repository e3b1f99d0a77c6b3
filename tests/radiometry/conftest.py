"""A simulated campaign, drawn once, and where the real data lie."""

import os
from pathlib import Path

import pytest

from tests.radiometry.campaigns import draw


@pytest.fixture(scope="session")
def drawn():
    return draw(11, isos=(3200.0, 12800.0))


@pytest.fixture
def real_data():
    """The folder of real files that no repository holds."""
    beside = Path(__file__).parents[2].parent / "shared" / "data"
    folder = Path(os.environ.get("STILB_TEST_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"no real data: {folder} does not exist (set STILB_TEST_DATA)")
    return folder
