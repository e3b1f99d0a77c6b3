"""A simulated campaign, drawn once, and where the real data lie."""

import pytest

from tests.radiometry.campaigns import draw
from tests.support.data import data_file


@pytest.fixture(scope="session")
def drawn():
    return draw(11, isos=(3200.0, 12800.0))


@pytest.fixture
def real_data():
    """The folder of real files that no repository holds."""
    return data_file(".")


@pytest.fixture
def lensfunpy():
    """The library that raw developers correct by; it needs one of the system's."""
    why = "liblensfun needs GLib: apt-get install libglib2.0-0"
    return pytest.importorskip("lensfunpy", reason=why, exc_type=ImportError)
