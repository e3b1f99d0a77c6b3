"""A map holds at every pixel what the equation says of it, block by block or whole."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from radiometry.findings import InputRejected
from radiometry.frame.exposure import Exposure
from radiometry.frame.roi import Polygon
from radiometry.luminance.maps import RIM_PX, MapScale, compute_map, find_map_scale
from radiometry.luminance.pixels import PERCENTILES, estimate_pixel_noise, order_pixels
from tests.radiometry.coefficients import COEFFICIENT
from tests.radiometry.frames import frame_of

SCALE = MapScale(slope_cd_m2_per_dn=0.004, dark_signal_dn=256.3, channel="green")
GREY = replace(SCALE, channel="grey")
PATTERNS = ("RGGB", "GBRG", "BGGR", "GRBG")


def make_frame(samples, cfa="RGGB", white=4095.0, row0=0, col0=0):
    return frame_of(samples, cfa=cfa, white=white, row0=row0, col0=col0, size=(1000, 1000))


def draw_samples(shape=(12, 17), top=4000, seed=1):
    return np.random.default_rng(seed).integers(200, top, shape).astype(np.uint16)


def mirrored(index, size):
    return -index if index < 0 else 2 * (size - 1) - index if index >= size else index


def expected_green(samples, cfa, row, col):
    """One pixel at a time, from the words of the documentation."""
    height, width = samples.shape
    if cfa[2 * (row % 2) + col % 2] == "G":
        return float(samples[row, col])
    places = [(row - 1, col), (row + 1, col), (row, col - 1), (row, col + 1)]
    return sum(float(samples[mirrored(r, height), mirrored(c, width)]) for r, c in places) / 4


@pytest.mark.parametrize("cfa", PATTERNS)
@pytest.mark.parametrize("top", [4000, 65000])
def test_green_sites_are_measured_and_the_others_are_means_of_their_neighbours(cfa, top):
    samples = draw_samples(top=top)
    found = compute_map(make_frame(samples, cfa, white=top + 1.0), SCALE)
    for row, col in np.ndindex(samples.shape):
        expected = np.float32((expected_green(samples, cfa, row, col) - 256.3) * 0.004)
        assert found[row, col] == expected
    assert found.dtype == np.float32


def test_grey_weighs_the_four_sites_alike_wherever_it_stands():
    """A mosaic of four constants has one local mean everywhere, the border included."""
    samples = np.tile(np.array([[1000, 2000], [2200, 400]]), (5, 6))
    found = compute_map(make_frame(samples), GREY)
    assert np.all(found == np.float32((1400.0 - 256.3) * 0.004))


def test_grey_is_the_binomial_mean():
    samples = draw_samples()
    kernel = np.outer([1, 2, 1], [1, 2, 1]) / 16
    found = compute_map(make_frame(samples), GREY)
    for row, col in itertools.product(range(1, 11), range(1, 16)):
        around = samples[row - 1 : row + 2, col - 1 : col + 2]
        assert found[row, col] == pytest.approx((np.sum(kernel * around) - 256.3) * 0.004, rel=1e-6)


def test_images_that_are_no_mosaic():
    samples = draw_samples((6, 7))
    colours = np.stack([samples // 2, samples, samples // 3], axis=-1)
    plain = ((samples - 256.3) * 0.004).astype(np.float32)
    assert np.array_equal(compute_map(make_frame(samples, "grey"), SCALE), plain)
    assert np.array_equal(compute_map(make_frame(colours, "rgb"), SCALE), plain)
    means = ((colours.sum(axis=2) / 3 - 256.3) * 0.004).astype(np.float32)
    assert np.array_equal(compute_map(make_frame(colours, "rgb"), GREY), means)


@pytest.mark.parametrize("scale", [SCALE, GREY], ids=["green", "grey"])
@pytest.mark.parametrize("cfa", PATTERNS)
def test_blocks_make_the_whole_to_the_last_bit(cfa, scale):
    samples = draw_samples((23, 30), top=4200)
    whole = compute_map(make_frame(samples, cfa), scale)
    for top, bottom, left, right in ((0, 7, 0, 30), (7, 16, 3, 18), (16, 23, 11, 30)):
        row0, col0 = max(0, top - RIM_PX), max(0, left - RIM_PX)
        part = samples[row0 : bottom + RIM_PX, col0 : right + RIM_PX]
        block = compute_map(make_frame(part, cfa, row0=row0, col0=col0), scale)
        inner = block[top - row0 : bottom - row0, left - col0 : right - col0]
        np.testing.assert_array_equal(inner, whole[top:bottom, left:right])


def test_saturated_green_makes_itself_and_its_neighbours_unknown():
    samples = np.full((8, 8), 1000)
    samples[2, 3] = 4095  # a green site of RGGB
    samples[5, 5] = 4095  # a blue one: no green is made of it
    found = compute_map(make_frame(samples), SCALE)
    unknown = {(2, 3), (1, 3), (3, 3), (2, 2), (2, 4)}
    assert set(map(tuple, np.argwhere(np.isnan(found)).tolist())) == unknown
    grey = np.isnan(compute_map(make_frame(samples), GREY))
    assert grey[1:4, 2:5].all()
    assert grey[4:7, 4:7].all()
    assert grey.sum() == 18


def test_saturation_of_other_images():
    samples = np.full((4, 4), 1000)
    samples[1, 2] = 4095
    assert np.argwhere(np.isnan(compute_map(make_frame(samples, "grey"), SCALE))).tolist() == [[1, 2]]
    colours = np.stack([samples, np.full((4, 4), 900), np.full((4, 4), 900)], axis=-1)
    assert not np.isnan(compute_map(make_frame(colours, "rgb"), SCALE)).any()
    assert np.isnan(compute_map(make_frame(colours, "rgb"), GREY)).sum() == 1


def test_a_map_needs_a_model_that_is_a_scale():
    bent = replace(COEFFICIENT, model="power", parameters=(30.0, 1.1))
    with pytest.raises(InputRejected, match="proportional"):
        find_map_scale((bent,), Exposure(exposure_time_s=0.01, f_number=4.0, iso=3200.0))


WHOLE = Polygon.from_points([(0, 0), (400, 0), (400, 300), (0, 300)])


def test_order_statistics_are_those_of_the_green_sites():
    samples = draw_samples((300, 400))
    samples[0, 0], samples[1, 1] = 1, 65535  # red and blue are not asked
    found = order_pixels(make_frame(samples), WHOLE, channel="green")
    greens = np.concatenate([samples[0::2, 1::2].ravel(), samples[1::2, 0::2].ravel()])
    assert found.pixels == greens.size
    assert (found.smallest.value_dn, found.largest.value_dn) == (greens.min(), greens.max())
    assert found.median.value_dn == np.median(greens)
    assert [p.value_dn for p in found.percentiles] == np.percentile(greens, PERCENTILES).tolist()


@pytest.mark.parametrize("channel", ["green", "grey"])
def test_a_pixels_noise_is_found_under_a_scene_with_structure(channel):
    """Shot noise on a ramp with an edge: the region's spread is a hundred times the noise."""
    random = np.random.default_rng(3)
    light = np.linspace(400.0, 3000.0, 400) * np.where(np.arange(300) < 150, 1.0, 0.5)[:, None]
    sigma = np.sqrt(4.0 + 0.04 * light)
    samples = np.rint(256 + light + sigma * random.standard_normal(light.shape))
    found = order_pixels(make_frame(samples), WHOLE, channel=channel)
    # the binomial mean of nine samples has the variance (6 / 16)^2 of one
    factor = 1.0 if channel == "green" else 6 / 16
    for pixel in (found.smallest, found.largest, *found.percentiles):
        expected = factor * np.sqrt(4.0 + 0.04 * (pixel.value_dn - 256) + 1 / 12)
        # an end bin holds a sixteenth of the pixels, whose mean level is not the extreme pixel's
        assert pixel.noise_dn == pytest.approx(expected, rel=0.2)
    assert found.median.noise_dn < 0.05


def test_noise_of_a_region_without_neighbours_is_that_of_rounding():
    curve = estimate_pixel_noise(np.array([[5]]), np.array([[True]]), parts=1, lag=2)
    assert curve.at(100.0) == pytest.approx(np.sqrt(1 / 12))


def test_a_region_between_the_green_sites_is_empty():
    with pytest.raises(InputRejected, match="no green pixel"):
        order_pixels(
            make_frame(draw_samples()), Polygon.from_points([(0, 0), (1, 0), (1, 1), (0, 1)]), channel="green"
        )
