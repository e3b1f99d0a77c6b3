"""Frames in blocks: figures worked out by hand, borders, regions, windows, transposition, JSON."""

import dataclasses

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.fitting.evidence import Region
from radiometry.frame import Frame
from radiometry.frame.packing import unpack
from radiometry.frame.roi import Polygon
from radiometry.vignetting.blocks import Grid, Site, average_radial, extract_features
from simulation.camera import change, take
from simulation.targets import FAST_LENS, plan_flat
from tests.radiometry.vignetting.flats import SMALL, row, whole


def make_frame(samples, cfa="RGGB", **changes):
    height, width = samples.shape[:2]
    fields = {
        "samples_dn": samples.astype(np.uint16),
        "row0": 0,
        "col0": 0,
        "height_px": height,
        "width_px": width,
        "cfa": cfa,
        "black_level_dn": (10.0, 11.0, 12.0, 13.0),
        "white_level_dn": (4095.0,) * 4,
    }
    return Frame(**(fields | changes))


@pytest.fixture(scope="module")
def header():
    return take(SMALL, plan_flat(SMALL, f_number=8.0), np.random.default_rng(0)).header


def extract(frame, header, *polygons):
    regions = [Region(name="", polygon=Polygon.from_points(each)) for each in polygons]
    regions = regions or [whole(frame.height_px, frame.width_px)]
    return extract_features(frame, regions, header=header).features


def by_name(features):
    return {each.channel: each for each in features.channels}


def test_each_channel_is_averaged_by_itself(header):
    samples = np.zeros((18, 20))
    samples[0::2, 0::2], samples[0::2, 1::2], samples[1::2, 0::2], samples[1::2, 1::2] = 100, 200, 300, 400
    samples[0, 0] = 132  # one of the 16 reds of the first block: +2 in its mean
    found = by_name(extract(make_frame(samples), header))
    assert list(found) == ["R", "G1", "G2", "B"]
    red = unpack(found["R"].mean_dn)
    assert red.shape == (3, 3)
    assert red[0, 0] == 102.0
    assert (red.ravel()[1:] == 100.0).all()
    for name, level in (("G1", 200.0), ("G2", 300.0), ("B", 400.0)):
        assert (unpack(found[name].mean_dn) == level).all()
    assert [found[name].black_level_dn for name in found] == [10.0, 11.0, 12.0, 13.0]
    # blocks of 8: 16 pixels of a channel, 8 x 4 and 4 x 2 and less at the far borders
    assert unpack(found["R"].n).tolist() == [[16, 16, 8], [16, 16, 8], [4, 4, 2]]
    # two of its 24 differences are 32: sqrt(2 * 32^2 / (2 * 24))
    assert unpack(found["R"].noise_dn)[0, 0] == pytest.approx(np.sqrt(2 * 32**2 / 48), rel=1e-6)


@pytest.mark.parametrize(("cfa", "greens"), [("GRBG", (0, 3)), ("BGGR", (2, 1)), ("GBRG", (3, 0))])
def test_a_green_is_g1_in_a_row_with_red(header, cfa, greens):
    samples = np.tile([[0, 1], [2, 3]], (8, 8))
    found = by_name(extract(make_frame(samples, cfa), header))
    assert [unpack(found[name].mean_dn)[0, 0] for name in ("G1", "G2")] == list(greens)


def test_noise_ignores_a_slope_of_the_light(header):
    random = np.random.default_rng(4)
    slope = 1000 + 3.0 * np.arange(512)[:, None] + 2.0 * np.arange(512)[None, :]
    samples = np.round(slope + 20.0 * random.standard_normal((512, 512)))
    (grey,) = extract(make_frame(samples, "grey"), header).channels
    noise = unpack(grey.noise_dn)
    assert noise.shape == (64, 64)
    # d^2 holds the slope twice: sqrt(400 + (9 + 4) / 4); 4096 blocks of about 64 pixels fix it to 0.2 %
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(np.sqrt(400 + 13 / 4 + 1 / 12), rel=0.01)
    assert samples[:8, :8].std() > 20.5  # what the plain deviation of a block would say


def test_clipped_samples_are_counted(header):
    samples = np.full((16, 16), 500)
    samples[0, :4] = 4095
    (grey,) = extract(make_frame(samples, "grey"), header).channels
    assert unpack(grey.clipped_share).tolist() == [[4 / 64, 0.0], [0.0, 0.0]]


def test_a_region_keeps_only_its_whole_blocks(header):
    samples = np.arange(24 * 32).reshape(24, 32)
    (grey,) = extract(make_frame(samples, "grey"), header, [(8, 0), (32, 0), (32, 20), (8, 20)]).channels
    assert unpack(grey.n).tolist() == [[0, 64, 64, 64], [0, 64, 64, 64], [0, 0, 0, 0]]
    assert unpack(grey.mean_dn)[0, 0] == 0.0
    with pytest.raises(InputRejected, match="whole block of 8 x 8"):
        extract(make_frame(samples, "grey"), header, [(1, 1), (7, 1), (7, 7), (1, 7)])


def test_a_window_says_what_the_whole_frame_says_there(header):
    random = np.random.default_rng(5)
    samples = random.integers(100, 900, (40, 56))
    polygon = [(8, 16), (48, 16), (48, 32), (8, 32)]
    frame = make_frame(samples)
    window = dataclasses.replace(frame, samples_dn=frame.samples_dn[15:33, 7:49], row0=15, col0=7)
    assert extract(window, header, polygon) == extract(frame, header, polygon)


def test_transposing_the_picture_transposes_the_blocks(header):
    samples = np.random.default_rng(6).integers(100, 900, (45, 130))
    one, other = (by_name(extract(make_frame(each), header)) for each in (samples, samples.T))
    for name, turned in (("R", "R"), ("G1", "G2"), ("G2", "G1"), ("B", "B")):
        for field in ("mean_dn", "noise_dn", "n", "clipped_share"):
            mine, theirs = unpack(getattr(one[name], field)), unpack(getattr(other[turned], field))
            np.testing.assert_allclose(mine, theirs.T, rtol=1e-6)


def test_a_rendered_picture_has_three_planes():
    lens = change(SMALL, cfa="rgb")
    features = row(take(lens, plan_flat(lens, f_number=8.0), np.random.default_rng(1))).features
    assert [each.channel for each in features.channels] == ["R", "G", "B"]
    levels = [np.median(unpack(each.mean_dn)) - 256.0 for each in features.channels]
    assert levels[0] / levels[1] == pytest.approx(0.6, rel=0.01)


def test_a_large_frame_has_at_most_64_blocks():
    grid = Grid.over(3648, 5472)
    assert grid.block_px == 86
    rows, cols = grid.axes(Site(row0=1, col0=0, step=2))
    assert (rows.starts.size, cols.starts.size) == (43, 64)
    assert rows.positions[0] == 1.0


def test_block_means_and_slopes_are_those_of_the_pixels():
    grid = Grid.over(20, 30)
    rows, cols = grid.axes(Site(row0=1, col0=0, step=2))
    centre, radius = (7.3, 18.1), grid.half_diagonal_px

    def means(row, col):
        return average_radial(rows, cols, centre_row_px=row, centre_col_px=col, radius_px=radius)

    found, by_row, by_col = means(*centre)
    squared = (np.arange(9, 17, 2)[:, None] - 7.3) ** 2 + (np.arange(16, 24, 2)[None, :] - 18.1) ** 2
    for power in (1, 2, 3):
        pixels = (squared / radius**2) ** power
        assert found[power - 1][1, 2] == pytest.approx(pixels.mean(), rel=1e-12)
    step = 1e-5
    for slopes, (up, down) in (
        (by_row, (means(7.3 + step, 18.1), means(7.3 - step, 18.1))),
        (by_col, (means(7.3, 18.1 + step), means(7.3, 18.1 - step))),
    ):
        np.testing.assert_allclose(slopes, (up[0] - down[0]) / (2 * step), rtol=1e-5, atol=1e-9)


def test_the_simulated_lens_is_what_it_says():
    lens = change(FAST_LENS, height_px=300, width_px=400, centre_px=(100.0, 200.0))
    share = lens.share(1.4)
    assert share[100, 200] == 1.0
    # 150 rows below the centre: r^2 = 0.36 of R = 250 px
    assert share[250, 200] == pytest.approx(1 - 0.62 * 0.36 + 0.20 * 0.36**2 - 0.08 * 0.36**3)
