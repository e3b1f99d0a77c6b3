import sys
from pathlib import Path

import pytest

# The makers beside these tests are theirs alone and no package.
sys.path.insert(0, str(Path(__file__).parent))

import boards


@pytest.fixture(scope="module")
def simulated():
    """Fifteen views of a known camera with a tenth of a pixel of noise."""
    return boards.simulate(seed=5, count=15, noise_px=0.1)


@pytest.fixture(scope="session")
def opencv_rows():
    """OpenCV's own set, corners and all."""
    folder = boards.DATA / "checkerboard"
    if not folder.is_dir():
        pytest.skip(f"no real data: {folder} does not exist (set STILB_TEST_DATA)")
    return tuple(boards.read_picture(path) for path in sorted(folder.glob("*.jpg")))
