import pytest

from tests.radiometry.geometry import boards
from tests.support.data import data_file


@pytest.fixture(scope="module")
def simulated():
    """Fifteen views of a known camera with a tenth of a pixel of noise."""
    return boards.simulate(seed=5, count=15, noise_px=0.1)


@pytest.fixture(scope="session")
def opencv_rows():
    """OpenCV's own set, corners and all."""
    return tuple(boards.read_picture(path) for path in sorted(data_file("checkerboard").glob("*.jpg")))
