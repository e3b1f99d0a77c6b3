"""The block of a frame: its place, its samples, what is refused, and that it survives JSON."""

import numpy as np
import pytest

from radiometry.findings import InputRejected, shared
from radiometry.fitting.evidence import Region
from radiometry.frame.packing import unpack
from radiometry.frame.roi import Polygon
from radiometry.noise.results import extract_features
from simulation.targets import COUNTING_SENSOR
from tests.radiometry.frames import frame_of

HEADER = COUNTING_SENSOR.describe()


def frame(samples, *, row0=0, col0=0, cfa="RGGB", whole=None):
    levels = {"black": (10.0, 20.0, 30.0, 40.0), "white": (4000.0, 4001.0, 4002.0, 4003.0)}
    return frame_of(samples, row0=row0, col0=col0, cfa=cfa, size=whole, **levels)


def rectangle(row0, col0, row1, col1):
    return Region(
        name="", polygon=Polygon.from_points([(col0, row0), (col1, row0), (col1, row1), (col0, row1)])
    )


def blocks_of(one, region):
    features = extract_features(one, [region], header=HEADER).features
    return {block.channel: block for block in features.blocks}


def numbered(rows, cols):
    """Every sample tells its place: 256 row + column."""
    return np.add.outer(256 * np.arange(rows), np.arange(cols))


def test_the_square_lies_in_the_middle_of_whole_cells():
    found = blocks_of(frame(numbered(100, 160)), rectangle(11, 21, 61, 121))
    # cells 6 to 29 by 11 to 59: the largest square has 24 a side, its middle column at cell 35
    assert {name: (b.row0, b.col0) for name, b in found.items()} == {
        "R": (12, 46),
        "G1": (12, 47),
        "G2": (13, 46),
        "B": (13, 47),
    }
    samples = unpack(found["B"].samples_dn)
    assert samples.shape == (24, 24)
    np.testing.assert_array_equal(samples, numbered(100, 160)[13:61:2, 47:95:2])
    assert found["B"].black_level_dn == 40.0
    assert found["G1"].white_level_dn == 4001.0


def test_it_is_never_larger_than_it_need_be():
    whole = np.zeros((300, 400))
    assert blocks_of(frame(whole), rectangle(0, 0, 300, 400))["R"].samples_dn.shape == (96, 96)
    grey = blocks_of(frame(whole, cfa="grey"), rectangle(0, 0, 300, 400))["grey"]
    assert (grey.samples_dn.shape, grey.row0, grey.col0) == ((96, 96), 102, 152)


@pytest.mark.parametrize("offset", [(0, 0), (5, 8), (6, 9), (7, 7)])
def test_a_window_gives_the_same_block_as_the_whole_frame(offset):
    row0, col0 = offset
    whole, region = numbered(100, 120), rectangle(20, 20, 80, 100)
    window = frame(whole[row0:, col0:], row0=row0, col0=col0, whole=(100, 120))
    assert blocks_of(window, region) == blocks_of(frame(whole), region)


def test_a_round_region_holds_a_smaller_square():
    angles = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = Polygon.from_points([(80 + 50 * np.cos(a), 80 + 50 * np.sin(a)) for a in angles])
    side = blocks_of(frame(np.zeros((160, 160)), cfa="grey"), Region(name="", polygon=circle))["grey"]
    assert 66 <= side.samples_dn.shape[0] <= 71  # 100 / sqrt(2)


@pytest.mark.parametrize(
    ("region", "message"),
    [(rectangle(10, 10, 41, 100), "no square of 16 x 16"), (rectangle(10.6, 10.6, 11.4, 11.4), "no pixel")],
)
def test_a_region_that_is_too_small_is_refused(region, message):
    with pytest.raises(InputRejected, match=message) as refused:
        blocks_of(frame(np.zeros((120, 120))), region)
    assert refused.value.code is shared.ROI_EMPTY


def test_white_and_zero_are_counted():
    samples = np.full((40, 40), 100)
    samples[:4, :] = 4000
    samples[4:5, :20] = 0
    block = blocks_of(frame(samples, cfa="grey"), rectangle(0, 0, 40, 40))["grey"]
    assert (block.clipped_share, block.zero_share) == (0.1, 20 / 1600)


def test_colour_planes_and_bands_have_their_names():
    planes = np.zeros((40, 40, 3))
    planes[..., 2] = 7
    found = blocks_of(frame(planes, cfa="rgb"), rectangle(0, 0, 40, 40))
    assert list(found) == ["R", "G", "B"]
    assert unpack(found["B"].samples_dn).max() == 7.0
