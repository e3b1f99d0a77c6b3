"""A region's histogram and clipped cells, on mosaics small enough to count by hand."""

import numpy as np

from radiometry.frame.statistics import ClippedCell, count_histogram, map_clipping
from tests.radiometry.frames import frame_of

WHITE = (100.0, 200.0, 150.0, 100.0)


def frame(samples, *, row0=0, col0=0, cfa="RGGB", white=WHITE):
    return frame_of(samples, row0=row0, col0=col0, cfa=cfa, black=(0.0,) * len(white), white=white)


def test_bins_are_shared_by_the_channels_and_hold_every_sample():
    window = frame([[10, 12, 10, 13], [11, 20, 11, 20]])
    found = count_histogram(window, np.ones((2, 4), bool))
    assert (found.first_dn, found.step_dn) == (10, 1)
    by_name = {each.channel: each.counts for each in found.channels}
    assert list(by_name) == ["R", "G1", "G2", "B"]
    assert by_name["R"] == (2, *[0] * 10)
    assert by_name["G1"] == (0, 0, 1, 1, *[0] * 7)
    assert by_name["G2"] == (0, 2, *[0] * 9)
    assert by_name["B"] == (*[0] * 10, 2)


def test_a_wide_spread_takes_wider_bins_and_only_the_region_counts():
    samples = np.arange(300, dtype=np.uint16).reshape(10, 30)
    inside = np.zeros((10, 30), bool)
    inside[1:, :] = True
    found = count_histogram(frame(samples, cfa="grey", white=(4095.0,)), inside)
    (grey,) = found.channels
    # 270 values in at most 128 bins: 3 DN each, 90 bins
    assert (found.first_dn, found.step_dn, grey.counts) == (30, 3, (3,) * 90)


def test_a_sample_is_clipped_at_the_white_of_its_own_site():
    # whites by site: R 100, G1 200, G2 150, B 100
    window = frame([[100, 150, 99, 200], [150, 99, 149, 100]], row0=4, col0=6)
    found = map_clipping(window, np.ones((2, 4), bool))
    assert (found.row0_px, found.col0_px, found.cell_px) == (4, 6, 1)
    assert [(each.row, each.col) for each in found.cells] == [(0, 0), (0, 3), (1, 0), (1, 3)]


def test_a_cell_tells_the_clipped_share_of_what_belongs_to_the_region():
    samples = np.zeros((96, 60), np.uint16)
    samples[2:4, 0] = 4095
    inside = np.ones((96, 60), bool)
    inside[2, 1] = False
    found = map_clipping(frame(samples, cfa="grey", white=(4095.0,)), inside)
    # 96 rows in 48 cells: 2 x 2 px, of which three belong and two are clipped
    assert found.cell_px == 2
    assert found.cells == (ClippedCell(row=1, col=0, share=2 / 3),)


def test_a_pixel_of_a_colour_image_is_clipped_with_one_of_its_planes():
    samples = np.zeros((2, 2, 3), np.uint16)
    samples[1, 0] = (0, 255, 0)
    colour = frame(samples, cfa="rgb", white=(255.0, 255.0, 255.0))
    assert map_clipping(colour, np.ones((2, 2), bool)).cells == (ClippedCell(row=1, col=0, share=1.0),)
    assert [each.channel for each in count_histogram(colour, np.ones((2, 2), bool)).channels] == [
        "R",
        "G",
        "B",
    ]
