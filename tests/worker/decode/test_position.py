"""Where a frame was taken: both hemispheres, both heights, and nowhere when the file does not know."""

import dataclasses

import pytest

from simulation.dng import ASCII, BYTE, LONG, RATIONAL
from tests.worker.decode.dng_variants import Variant, make_dng, make_samples
from worker.decode import reader

LANSING = {
    1: (ASCII, "N"),
    2: (RATIONAL, [(42, 1), (43, 1), (57, 1)]),
    3: (ASCII, "W"),
    4: (RATIONAL, [(84, 1), (33, 1), (2016, 100)]),
    5: (BYTE, b"\0"),
    6: (RATIONAL, (2625, 10)),
}


@pytest.fixture
def position(save):
    def read(gps, **changes):
        path = save(make_dng(make_samples(32, 48, 16), Variant(gps=gps, **changes)))
        header = reader.read_header(path)
        return header.latitude_deg, header.longitude_deg, header.altitude_m

    return read


@pytest.mark.parametrize("order", ["<", ">"])
def test_degrees_minutes_and_seconds(order, position):
    expected = (42 + 43 / 60 + 57 / 3600, -(84 + 33 / 60 + 20.16 / 3600), 262.5)
    assert position(LANSING, order=order) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("letters", "signs"),
    [(("N", "E"), (1, 1)), (("S", "E"), (-1, 1)), (("s", "w"), (-1, -1)), (("N", "W"), (1, -1))],
)
def test_hemispheres(letters, signs, position):
    found = position(LANSING | {1: (ASCII, letters[0]), 3: (ASCII, letters[1])})
    assert found[:2] == pytest.approx((signs[0] * 42.7325, signs[1] * 84.5556), abs=1e-9)


def test_minutes_with_a_fraction_and_no_seconds(position):
    found = position(LANSING | {2: (RATIONAL, [(10, 1), (3075, 100), (0, 1)])})
    assert found[0] == pytest.approx(10 + 30.75 / 60, abs=1e-12)


def test_below_sea_level(position):
    assert position(LANSING | {5: (BYTE, b"\1")})[2] == -262.5


@pytest.mark.parametrize(
    "change",
    [
        {2: (RATIONAL, [(42, 1), (43, 1), (0, 0)])},
        {4: (RATIONAL, [(84, 0), (33, 1), (20, 1)])},
        {1: (ASCII, "")},
        {3: (ASCII, "X")},
        {2: (RATIONAL, [(91, 1), (0, 1), (0, 1)])},
        {4: (RATIONAL, [(181, 1), (0, 1), (0, 1)])},
        {9: (ASCII, "V")},
        {2: (RATIONAL, [(0, 1)] * 3), 4: (RATIONAL, [(0, 1)] * 3)},
    ],
)
def test_a_position_that_is_not_known_is_none(change, position):
    assert position(LANSING | change) == (None, None, None)


@pytest.mark.parametrize("missing", [1, 2, 3, 4])
def test_half_a_position_is_none(missing, position):
    assert position({tag: value for tag, value in LANSING.items() if tag != missing}) == (None, None, None)


@pytest.mark.parametrize("change", [{6: (RATIONAL, (100, 0))}, {6: (RATIONAL, (4_000_000_000, 1))}])
def test_a_height_that_is_not_known_leaves_the_position(change, position):
    found = position(LANSING | change)
    assert found[0] == pytest.approx(42.7325, abs=1e-9)
    assert found[2] is None


def test_a_directory_outside_the_file_is_no_position(save):
    path = save(make_dng(make_samples(32, 48, 16), Variant(main={34853: (LONG, 1 << 30)})))
    assert reader.read_header(path).latitude_deg is None


def test_bands_follow_the_tiles_from_the_visible_corner(save):
    tiled = Variant(compression="ljpeg", bits=12, tile=(16, 16))
    samples = make_samples(48, 48, 12)
    whole = reader.read_header(save(make_dng(samples, tiled)))
    cut = dataclasses.replace(tiled, active_area=(20, 4, 44, 44))
    inner = reader.read_header(save(make_dng(samples, cut), "b.dng"))
    assert (whole.band_rows, whole.first_band_rows) == (16, 16)
    assert (inner.band_rows, inner.first_band_rows) == (16, 12)
