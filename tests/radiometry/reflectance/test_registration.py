"""Refinement of an alignment: a known displacement is found as well as stated, and noise is not trusted."""

import cv2
import numpy as np
import pytest

from radiometry.reflectance.alignment import register
from tests.support import reader
from tests.support.data import data_file


def make_ground(seed, shape=(480, 640)):
    """Blobs with edges at several scales, as fields and crowns have."""
    random = np.random.default_rng(seed)
    ground = np.zeros(shape, np.float32)
    for size in (6, 16, 40):
        noise = cv2.GaussianBlur(random.standard_normal(shape).astype(np.float32), (0, 0), size)
        ground += np.where(noise > 0.0, 0.1, 0.0).astype(np.float32)
    return ground


def displace(ground, matrix):
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    return cv2.warpAffine(
        ground, np.linalg.inv(np.vstack((matrix, (0, 0, 1))))[:2], ground.shape[::-1], flags=flags
    )


@pytest.mark.parametrize("reach", [0, 64])
def test_a_known_displacement_is_found_to_its_residual(reach):
    random = np.random.default_rng(2)
    matrix = np.array([[1.002, -0.004, 3.3], [0.004, 0.998, -5.6]])
    if reach:
        matrix[:, 2] += (-40.0, 20.0)
    ground = make_ground(1)
    # another band: the contrast turned, and noise of its own
    other = 0.5 - displace(ground, matrix) + random.normal(0.0, 0.01, ground.shape).astype(np.float32)
    fixed = ground + random.normal(0.0, 0.01, ground.shape).astype(np.float32)
    found = register(fixed, other, reach_px=reach)
    x, y = np.meshgrid([80.0, 320.0, 560.0], [80.0, 240.0, 400.0])
    places = np.stack((x.ravel(), y.ravel(), np.ones(9)))
    errors = np.hypot(*(np.reshape(found.matrix, (2, 3)) @ places - matrix @ places))
    assert found.trusted
    assert found.residual_px < 0.4
    assert errors.max() < max(0.25, found.residual_px)


def test_noise_and_bare_ground_are_not_trusted():
    random = np.random.default_rng(3)
    water = [random.normal(0.05, 0.01, (480, 640)).astype(np.float32) for _ in range(2)]
    bare = np.full((480, 640), 0.2, np.float32)
    for fixed, other in (water, (bare, bare), (np.full_like(bare, np.nan), bare)):
        found = register(fixed, other)
        assert not found.trusted
        assert found.patches <= 0.05 * max(found.tried, 1)


def test_patches_on_one_side_give_a_shift_and_no_turn_of_the_rest():
    ground = make_ground(1)
    ground[:, 240:] = 0.2
    found = register(ground, displace(ground, np.array([[1.002, 0.0, 3.3], [0.0, 1.002, -5.6]])))
    assert found.trusted
    assert (found.matrix[:2], found.matrix[3:5]) == ((1.0, 0.0), (0.0, 1.0))


def read(name):
    path = data_file(name)
    header = reader.read_header(path)
    size = {"height": header.height_px, "width": header.width_px}
    return reader.read_window(path, row0=0, col0=0, **size).samples_dn.astype(np.float32)


@pytest.mark.parametrize(
    ("names", "reach", "residual"),
    [("rededge/0000SET_000_IMG_0001_{}.tif", 96, 0.35), ("p4m/DJI_001{}.TIF", 24, 0.4)],
)
def test_bands_of_a_real_flight_agree_to_a_fraction_of_a_pixel(names, reach, residual):
    planes = [read(names.format(number)) for number in (4, 5)]
    found = register(*planes, reach_px=reach)
    assert found.trusted
    assert found.residual_px < residual


def test_a_scene_close_by_is_not_trusted():
    """The real Sequoia capture shows a window sill half a metre away: no map of the plane fits it."""
    planes = [read(f"sequoia/IMG_180413_080658_0000_{band}.TIF") for band in ("NIR", "RED")]
    assert not register(*planes, reach_px=24).trusted
