"""The place of a frame on level ground, against figures worked out by hand, and shadows of a real file."""

import math
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
import scipy
import tifffile

from radiometry.findings import InputRejected
from radiometry.frame import PositionFix, StatedAngle
from radiometry.frame.multispectral import RigGeometry
from radiometry.frame.place import Place
from radiometry.frame.pose import GroundHeight
from radiometry.reflectance.sun import find_place, locate_sun
from tests.support import reader
from tests.support.data import data_file
from worker.maps.tiff import MapFacts, encode_band, write_tiff

LATITUDE_DEG, LONGITUDE_DEG = 40.0, -87.0
# metres of a degree by the series of the US Navy's manual, not by radii of curvature
_PHI = math.radians(LATITUDE_DEG)
NORTH_M = 111132.954 - 559.822 * math.cos(2 * _PHI) + 1.175 * math.cos(4 * _PHI)
EAST_M = 111412.84 * math.cos(_PHI) - 93.5 * math.cos(3 * _PHI) + 0.118 * math.cos(5 * _PHI)
# 200 x 100 px and 1000 px of focal length 100 m above the ground: 0.1 m a pixel, 20 m x 10 m
LENS = RigGeometry(
    model="perspective", principal_point_px=(99.5, 49.5), focal_length_px=1000.0, distortion=(0.0,) * 5
)
GIMBAL, CAMERA = ("drone-dji:Gimbal", "Degree"), ("camera:", "")
FIX = PositionFix(kind="single", u_latitude_m=3.0, u_longitude_m=4.0)
HEIGHT = GroundHeight(height_above_ground_m=100.0, height_u_m=2.0)


@pytest.fixture(scope="module")
def real():
    return reader.read_header(data_file("p4m/DJI_0015.TIF"))


def make_header(real, angles_deg, *, mount=GIMBAL, lens=LENS, **more):
    names = (f"{mount[0]}{axis}{mount[1]}" for axis in ("Yaw", "Pitch", "Roll"))
    said = {
        "attitude": tuple(StatedAngle(name=n, value=v) for n, v in zip(names, angles_deg, strict=True)),
        "multispectral": replace(real.multispectral, geometry=lens),
        "position_fix": FIX,
        "altitude_m": 250.0,
    }
    where = {"latitude_deg": LATITUDE_DEG, "longitude_deg": LONGITUDE_DEG}
    return replace(real, **where, width_px=200, height_px=100, **said | more)


def in_metres(longitude, latitude):
    return (longitude - LONGITUDE_DEG) * EAST_M, (latitude - LATITUDE_DEG) * NORTH_M


def locate(place, col, row):
    a, b, c, d, e, f = place.transform
    return in_metres(a + b * col + c * row, d + e * col + f * row)


@pytest.mark.parametrize(
    ("mount", "yaw_deg", "top_left", "top_right"),
    [
        (GIMBAL, 0.0, (-10, 5), (10, 5)),
        (GIMBAL, 90.0, (5, 10), (5, -10)),  # the upper edge lies in the east, the right one in the south
        (GIMBAL, 180.0, (10, -5), (-10, -5)),
        (CAMERA, -90.0, (-5, -10), (-5, 10)),
    ],
)
def test_the_corners_of_a_frame_that_looks_straight_down(real, mount, yaw_deg, top_left, top_right):
    down_deg = -90.0 if mount is GIMBAL else 0.0
    place = find_place(make_header(real, (yaw_deg, down_deg, 0.0), mount=mount), HEIGHT)
    assert (place.form, place.crs, place.tie_points) == ("affine", "EPSG:4326", ())
    expected = [top_left, top_right, tuple(-v for v in top_left), tuple(-v for v in top_right)]
    for corner, place_m, (col, row) in zip(
        place.corners, expected, [(0, 0), (200, 0), (200, 100), (0, 100)], strict=True
    ):
        assert in_metres(*corner) == pytest.approx(place_m, abs=2e-3)
        assert locate(place, col, row) == pytest.approx(place_m, abs=2e-3)
    # the axis meets the ground in the middle, and half a pixel from the corner is the first pixel's centre
    assert locate(place, 100, 50) == pytest.approx((0, 0), abs=1e-4)
    assert place.pixel_m == pytest.approx(0.1, rel=1e-9)
    assert place.residual_m == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize(
    ("mount", "angles_deg", "centre"),
    [
        (GIMBAL, (0.0, -80.0, 0.0), (0, 1)),  # forward, to the north
        (GIMBAL, (90.0, -80.0, 0.0), (1, 0)),
        (CAMERA, (0.0, 10.0, 0.0), (0, 1)),  # the nose up, as an aircraft pitches
        (CAMERA, (0.0, 0.0, 10.0), (-1, 0)),  # the right wing down: the camera looks to the left
        (GIMBAL, (180.0, -90.0, 180.0), (0, 0)),  # DJI's other name of north up
    ],
)
def test_a_tilted_camera_looks_where_its_angles_say(real, mount, angles_deg, centre):
    place = find_place(make_header(real, angles_deg, mount=mount), HEIGHT)
    away_m = 100 * math.tan(math.radians(10))
    corners = [in_metres(*corner) for corner in place.corners]
    east_m, north_m = _cross(corners)
    assert (east_m, north_m) == pytest.approx([away_m * each for each in centre], abs=5e-3)
    assert place.tilt_deg == pytest.approx(10.0 if any(centre) else 0.0, abs=1e-5)
    if angles_deg == (180.0, -90.0, 180.0):
        assert corners[0] == pytest.approx((-10, 5), abs=2e-3)


def _cross(corners):
    """Return where the diagonals meet: straight lines stay straight."""
    a, b, c, d = map(np.array, corners)
    along = np.linalg.solve(np.column_stack((c - a, b - d)), b - a)
    return tuple(a + along[0] * (c - a))


def test_the_uncertainty_of_a_place_by_hand(real):
    place = find_place(make_header(real, (0.0, -90.0, 0.0)), HEIGHT)
    corner_m, rad = math.hypot(10, 5), math.radians(1)
    along, across = (100 * (1 + (x / 100) ** 2) * rad for x in (10, 5))
    tilt_m = math.hypot(along, across, 10 * 5 / 100 * rad * math.sqrt(2))
    expected = {
        "position": (5.0, 5.0),
        "height above ground": (0.0, corner_m * 2 / 100),
        "tilt": (100 * rad * math.sqrt(2), tilt_m),
        "yaw": (0.0, corner_m * 3 * rad),
        "affine transformation": (0.0, 0.0),
    }
    found = {share.source: (share.u_centre_m, share.u_corner_m) for share in place.budget}
    assert found.keys() == expected.keys()
    for source, figures in expected.items():
        assert found[source] == pytest.approx(figures, rel=1e-4, abs=1e-9), source
    assert place.u_centre_m == pytest.approx(math.hypot(5, expected["tilt"][0]), rel=1e-6)
    assert place.u_corner_m == pytest.approx(math.hypot(*(of[1] for of in expected.values())), rel=1e-4)


def test_what_is_stated_of_the_height_is_used_in_its_order(real):
    header = make_header(real, (0.0, -90.0, 0.0))
    take_off, stated = find_place(header, GroundHeight()), find_place(header, HEIGHT)
    ground = find_place(header, GroundHeight(ground_altitude_m=190.0))
    heights = [(each.height_source, each.height_above_ground_m) for each in (take_off, stated, ground)]
    assert heights == [("take_off", 19.94), ("request", 100.0), ("ground_altitude", 60.0)]
    for wrong in (
        GroundHeight(ground_altitude_m=250.0),
        GroundHeight(ground_altitude_m=10.0, height_above_ground_m=10.0),
    ):
        with pytest.raises(InputRejected) as refusal:
            find_place(header, wrong)
        assert refusal.value.code == "height_unusable"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"latitude_deg": None, "longitude_deg": None}, "no position"),
        ({"attitude": ()}, "no yaw, pitch and roll of the camera"),
        ({"height_above_takeoff_m": None}, "state height_above_ground_m"),
        ({"multispectral": None}, "its lens"),
    ],
)
def test_what_is_not_determined_has_no_place_and_a_reason(real, changes, reason):
    place = find_place(replace(make_header(real, (0.0, -90.0, 0.0)), **changes), GroundHeight())
    assert (place.form, place.transform, place.crs) == ("none", None, None)
    assert reason in place.detail


def test_the_horizon_is_not_on_the_ground(real):
    place = find_place(make_header(real, (0.0, -12.0, 0.0)), HEIGHT)
    assert (place.form, "80 deg off the vertical" in place.detail) == ("none", True)


def write(path, place, header):
    tiles = encode_band(np.zeros((100, 200), np.float32))
    write_tiff(path, tiles, MapFacts(header=header, exposure=None, software="x", description={}, place=place))
    with tifffile.TiffFile(path) as file:
        return file.pages[0].geotiff_tags


def test_a_strong_tilt_and_a_known_place_leave_tie_points(real, tmp_path):
    """37 degrees wide, at 45 degrees: an affine transformation is off by more than the place is uncertain."""
    header = make_header(real, (0.0, -45.0, 0.0), lens=replace(LENS, focal_length_px=300.0))
    place = find_place(header, HEIGHT)
    assert (place.form, len(place.tie_points)) == ("tie_points", 11 * 11)
    assert place.residual_m > place.u_centre_m
    keys = write(tmp_path / "map.tif", place, header)
    assert "ModelTransformation" not in keys
    points = np.reshape(keys["ModelTiepoint"], (-1, 6))
    assert points[0][[0, 1, 3, 4]] == pytest.approx((0, 0, *place.corners[0]), rel=1e-12)
    middle = points[60]
    # straight ahead at 45 degrees lies as far as the camera is high
    assert tuple(middle[:2]) == (100, 50)
    assert in_metres(*middle[3:5]) == pytest.approx((0, 100), abs=0.02)


def test_tifffile_reads_the_place_of_a_map(real, tmp_path):
    header = make_header(real, (90.0, -90.0, 0.0))
    place = find_place(header, HEIGHT)
    keys = write(tmp_path / "map.tif", place, header)
    assert (keys["GTModelTypeGeoKey"], keys["GeographicTypeGeoKey"], keys["GTRasterTypeGeoKey"]) == (
        2,
        4326,
        1,
    )
    matrix = np.array(keys["ModelTransformation"])
    for (col, row), corner in zip([(0, 0), (200, 0), (200, 100)], place.corners, strict=False):
        assert (matrix @ (col, row, 0, 1))[:2] == pytest.approx(corner, abs=2e-8)
    assert not write(tmp_path / "none.tif", Place(form="none", detail=""), header)


def test_the_shadows_of_a_real_p4_fall_away_from_the_sun(real):
    """Maize at 11:01 EDT (tried by shadows, as no file tells what its yaw is counted from)."""
    place = find_place(real, GroundHeight())
    band = tifffile.imread(data_file("p4m/DJI_0015.TIF"))[:225, :550].astype(float)
    band -= scipy.ndimage.gaussian_filter(band, 30)
    plants = (band > np.percentile(band, 93)) - 0.07
    shadows = (band < np.percentile(band, 10)) - 0.1
    found = scipy.signal.fftconvolve(shadows, plants[::-1, ::-1], "same")[72:153, 235:316]
    down, right = np.array(np.unravel_index(found.argmax(), found.shape)) - 40
    _, b, c, _, e, f = place.transform
    east = (b * right + c * down) * EAST_M
    north = (e * right + f * down) * NORTH_M
    sun = locate_sun(
        datetime(2020, 6, 5, 15, 1, 1, tzinfo=UTC),
        latitude_deg=real.latitude_deg,
        longitude_deg=real.longitude_deg,
    )
    away_deg = math.degrees(math.atan2(east, north)) - (sun.azimuth_deg + 180)
    assert abs((away_deg + 180) % 360 - 180) < 20
    assert math.hypot(right, down) > 10
