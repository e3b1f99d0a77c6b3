"""Vegetation indices: their formula, one capture only, and bands brought onto one another."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radiometry.findings import InputRejected
from radiometry.frame.multispectral import RigGeometry
from radiometry.frame.roi import Polygon, Window, mask
from radiometry.reflectance import indices as reflectance_indices
from radiometry.reflectance.alignment import align, find_directions, move_region, project, rotate_into_rig
from radiometry.reflectance.indices import align_band, read_formula
from simulation.camera import change as resize
from simulation.sequoia import SEQUOIA
from simulation.sequoia import capture as expose
from tests.radiometry.reflectance.captures import CAMERA, seeded

FISHEYE = RigGeometry(
    model="fisheye",
    principal_point_px=(621.7, 481.3),
    fisheye_affine=(1657.9, 0.3, -0.2, 1656.1),
    fisheye_polynomial=(0.0, 1.0, 0.00736, -0.1375),
    rotation_deg=(0.0, 0.0, 0.0),
)
PERSPECTIVE = RigGeometry(
    model="perspective",
    principal_point_px=(627.6, 479.9),
    focal_length_px=1449.4,
    distortion=(-0.0968, 0.1404, -0.023, 0.00028, 0.00066),
    rotation_deg=(0.0, 0.0, 0.0),
)


def turn(lens, omega=0.0, phi=0.0, kappa=0.0):
    return replace(lens, rotation_deg=(omega, phi, kappa))


def capture(surface, rotate=None):
    """Maps of known reflectance in all bands; ``rotate`` of the rig's bands."""
    size = resize(SEQUOIA, height_px=60, width_px=80)
    shots = expose(size, seeded(), reflectance=dict.fromkeys(CAMERA.bands, 0.1))
    return {
        name: reflectance_indices.BandMap(
            header=_turned(shot.header, rotate), reflectance=np.full((60, 80), surface[name], np.float32)
        )
        for name, shot in shots.items()
    }


def _turned(header, rotate):
    if rotate is None:
        return header
    band = header.multispectral
    lens = replace(band.geometry, rotation_deg=rotate)
    return replace(header, multispectral=replace(band, geometry=lens))


SURFACE = {"green": 0.08, "red": 0.05, "red_edge": 0.25, "nir": 0.45}
STRAIGHT = capture(SURFACE, rotate=(0.0, 0.0, 0.0))


def compute(index, bands):
    planes = {name: band.reflectance for name, band in bands.items()}
    return reflectance_indices.compute_index(read_formula(index), planes)


@pytest.mark.parametrize(
    ("index", "expected"),
    [
        ("ndvi", 0.40 / 0.50),
        ("ndre", 0.20 / 0.70),
        ("gndvi", 0.37 / 0.53),
        ("evi2", 2.5 * 0.40 / (0.45 + 2.4 * 0.05 + 1)),
        ("savi", 1.5 * 0.40 / (0.45 + 0.05 + 0.5)),
        ("nir / RED_EDGE - 1", 0.8),
    ],
)
def test_indices_by_hand(index, expected):
    found = compute(index, STRAIGHT)
    assert found.values == pytest.approx(np.full((60, 80), expected), rel=1e-6)
    assert found.values.dtype == np.float32


def test_an_index_does_not_exist_where_there_is_no_light_or_no_number():
    bands = capture({**SURFACE, "nir": 0.0, "red": 0.0}, rotate=(0.0, 0.0, 0.0))
    nir = bands["nir"].reflectance.copy()
    nir[10, 10] = np.nan
    nir[20, 20] = 0.3
    nir[30, 30] = -0.3
    bands["nir"] = replace(bands["nir"], reflectance=nir)
    found = compute("ndvi", bands)
    assert np.argwhere(np.isfinite(found.values)).tolist() == [[20, 20]]
    assert found.undefined == 60 * 80 - 1


def change(bands, name, band=None, plane=None, **header):
    told = bands[name]
    changed = replace(told.header, multispectral=replace(told.header.multispectral, **(band or {})), **header)
    surface = told.reflectance if plane is None else plane
    return {**bands, name: replace(told, header=changed, reflectance=surface)}


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"band": {"capture_id": "another"}}, "not bands of one capture"),
        ({"serial": "another"}, "not bands of one capture"),
        ({"plane": np.zeros((30, 40), np.float32)}, "not bands of one capture"),
        ({"band": {"geometry": None}}, "RigRelatives"),
        ({"band": {"geometry": replace(FISHEYE, rotation_deg=None)}}, "RigRelatives"),
        ({"band": {"geometry": replace(FISHEYE, fisheye_affine=())}}, "RigRelatives"),
        ({"band": {"geometry": replace(FISHEYE, fisheye_affine=(1.0, 1.0, 1.0, 1.0))}}, "RigRelatives"),
        ({"band": {"geometry": replace(FISHEYE, fisheye_polynomial=(0.0, 1.0, -5.0))}}, "RigRelatives"),
        ({"band": {"geometry": replace(PERSPECTIVE, focal_length_px=None)}}, "RigRelatives"),
        ({"band": {"geometry": replace(PERSPECTIVE, distortion=(0.1,))}}, "RigRelatives"),
    ],
)
def test_bands_that_cannot_be_aligned_are_refused(changes, match):
    with pytest.raises(InputRejected, match=match) as refusal:
        align_band(change(STRAIGHT, "red", **changes)["red"], STRAIGHT["nir"])
    assert refusal.value.code == "bands_not_aligned"


def test_no_capture_id_is_no_capture():
    bands = change(change(STRAIGHT, "red", band={"capture_id": None}), "nir", band={"capture_id": None})
    with pytest.raises(InputRejected, match="one capture"):
        align_band(bands["red"], bands["nir"])


@given(st.sampled_from([FISHEYE, PERSPECTIVE]), st.floats(0, 1280), st.floats(0, 960))
def test_a_pixel_s_direction_leads_back_to_it(lens, x, y):
    direction = find_directions(lens, x=np.array([x]), y=np.array([y]))
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    found_x, found_y = project(lens, direction)
    # 4096 steps of the angle: an interpolation error of some 1e-4 pixels
    assert (found_x[0], found_y[0]) == (pytest.approx(x, abs=1e-2), pytest.approx(y, abs=1e-2))


def test_the_optical_axis_is_the_principal_point():
    for lens in (FISHEYE, PERSPECTIVE):
        direction = find_directions(
            lens, x=np.array([lens.principal_point_px[0]]), y=np.array([lens.principal_point_px[1]])
        )
        assert direction[0] == pytest.approx([0.0, 0.0, 1.0], abs=1e-9)


def draw_spot(row, col, shape=(960, 1280)):
    rows, cols = np.mgrid[: shape[0], : shape[1]]
    return np.exp(-((rows - row) ** 2 + (cols - col) ** 2) / 50.0).astype(np.float32)


SIZE = {"height_px": 960, "width_px": 1280}
WHOLE = Polygon.from_points([(0, 0), (1280, 0), (1280, 960), (0, 960)])


@pytest.mark.parametrize("lens", [FISHEYE, PERSPECTIVE], ids=["fisheye", "perspective"])
def test_a_region_holds_in_the_other_band_what_it_holds_in_the_first(lens):
    """A spot in the other band, at the moved region's middle, is brought to the region's own middle."""
    turned = turn(lens, -0.43, -0.32, 0.5)
    region = Polygon.from_points([(695, 297), (706, 297), (706, 304), (695, 304)])
    here, there = move_region(region, of=turned, onto=lens, **SIZE)
    assert here == region
    x, y = np.mean(there.points, axis=0)
    assert np.hypot(x - 700.5, y - 300.5) > 8.0
    found = align(draw_spot(y - 0.5, x - 0.5), of=turned, onto=lens)
    inside = mask(region, Window(row0=0, col0=0, height=960, width=1280))
    assert np.unravel_index(np.nanargmax(np.where(inside, found, np.nan)), found.shape) == (300, 700)
    assert np.nanmax(found[inside]) == np.nanmax(found)


def test_of_a_whole_frame_both_bands_keep_what_both_see():
    # 1449.4 tan(2 deg) = 51 px in the middle, a fifth more at the rim, where the lens draws wider
    turned = turn(PERSPECTIVE, phi=2.0)
    here, there = move_region(WHOLE, of=turned, onto=PERSPECTIVE, **SIZE)
    spans = [np.ptp(np.array(region.points), axis=0) for region in (here, there)]
    assert spans[0][0] == pytest.approx(1280 - 56, abs=6)
    assert spans[0] == pytest.approx(spans[1], abs=8)
    # and so from the other side
    back, again = move_region(there, of=PERSPECTIVE, onto=turned, **SIZE)
    for found, expected in ((back, there), (again, here)):
        for end in (np.min, np.max):
            ends = [end(np.array(region.points), axis=0) for region in (found, expected)]
            assert ends[0] == pytest.approx(ends[1], abs=1e-3)


@pytest.mark.parametrize("phi", [20.0, 120.0])
def test_a_region_that_the_other_band_does_not_see_is_refused(phi):
    region = Polygon.from_points([(695, 297), (706, 297), (706, 304), (695, 304)])
    with pytest.raises(InputRejected, match="looks a little aside") as refusal:
        move_region(region, of=turn(PERSPECTIVE, phi=3 * phi / 2), onto=PERSPECTIVE, **SIZE)
    assert refusal.value.code == "roi_outside_frame"


def test_turning_about_x_moves_the_image_along_y():
    """omega = +1 degree turns the band's axis upwards: what lies straight ahead is lower in its image."""
    lens = PERSPECTIVE
    direction = np.array([[0.0, 0.0, 1.0]])
    x, y = project(lens, direction @ rotate_into_rig(turn(lens, omega=1.0)))
    assert x[0] == pytest.approx(lens.principal_point_px[0], abs=0.1)
    assert y[0] - lens.principal_point_px[1] == pytest.approx(1449.4 * np.tan(np.radians(1.0)), rel=0.01)


def test_where_the_other_band_did_not_look_there_is_nothing():
    found = align(np.ones((960, 1280), np.float32), of=turn(PERSPECTIVE, phi=5.0), onto=PERSPECTIVE)
    assert np.isnan(found).any(axis=0).sum() > 80
    assert np.nanmin(found) == pytest.approx(1.0)


@pytest.mark.parametrize("which", ["of", "onto"])
@pytest.mark.parametrize(
    "wild",
    [
        {"focal_length_px": 1e-300},
        {"distortion": (1e14, -1e14, 1e14, 1e14, 1e14)},
        {"principal_point_px": (1e14, -1e14)},
        {"rotation_deg": (0.0, 170.0, 0.0)},
    ],
)
def test_a_lens_that_cannot_be_sees_nothing(wild, which):
    """Positions that are no numbers must not reach the resampling: it would read beside the memory."""
    lenses = {"of": PERSPECTIVE, "onto": PERSPECTIVE} | {which: replace(PERSPECTIVE, **wild)}
    found = align(np.ones((60, 80), np.float32), **lenses)
    assert np.isnan(found).mean() > 0.99
