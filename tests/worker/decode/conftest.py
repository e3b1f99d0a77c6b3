import os
import sys
from pathlib import Path

import pytest

# The writers beside these tests are theirs alone and no package.
sys.path.insert(0, str(Path(__file__).parent))

_DATA = Path(os.environ.get("STILB_TEST_DATA", Path(__file__).parents[3].parent / "shared" / "data"))


@pytest.fixture(scope="session")
def real_files():
    if not _DATA.is_dir():
        pytest.skip(f"the real files are not at {_DATA} (STILB_TEST_DATA)")
    return _DATA


@pytest.fixture
def save(tmp_path):
    """Writes bytes to a file and returns its path."""

    def write(content, name="frame.dng"):
        path = tmp_path / name
        path.write_bytes(content)
        return path

    return write
