"""What other programs read, and the undistorted picture."""

import json
import math
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest

from radiometry.findings import InputRejected, shared
from radiometry.geometry.camera import find_directions, undistort
from radiometry.geometry.exports import EXPORTS, export_json, export_opencv
from radiometry.geometry.fit import fit_geometry
from radiometry.specification.exports import ExportSubject
from tests.radiometry.geometry.boards import CAMERA, FREE, SQUARE

SUBJECT = ExportSubject(
    calibration_id="cal",
    make="Canon",
    model="EOS 5D",
    serial="1",
    lens_make="L",
    lens_model="Lens 15mm f/1.4",
    pixel_pitch_um=4.65,
)
SMALL = replace(CAMERA, height_px=120, width_px=160, fx_px=130, fy_px=128, cx_px=83, cy_px=57)


@pytest.fixture(scope="module")
def fit(simulated):
    return fit_geometry(simulated, replace(FREE, pixel_pitch_um=4.65))


def test_opencv_reads_its_file(fit, tmp_path):
    path = tmp_path / "camera.yml"
    path.write_text(export_opencv(fit), encoding="ascii")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    np.testing.assert_array_equal(storage.getNode("camera_matrix").mat(), fit.camera.matrix)
    distortion = storage.getNode("distortion_coefficients").mat()
    np.testing.assert_array_equal(distortion, fit.camera.distortion.reshape(1, 5))
    assert storage.getNode("image_width").real() == 640
    assert storage.getNode("image_height").real() == 480
    assert storage.getNode("board_width").real() == 9
    assert storage.getNode("avg_reprojection_error").real() == fit.rms_px
    assert storage.getNode("per_view_reprojection_errors").mat().shape == (15, 1)
    storage.release()


def test_json_holds_all_that_the_others_hold(fit):
    read = json.loads(export_json(fit, camera_name="camera"))
    assert {name: each["value"] for name, each in read["parameters"].items()} == {
        each.name: each.value for each in fit.coefficients
    }
    order = read["covariance"]["order"]
    place = order.index("k3")
    variance = read["covariance"]["matrix"][place][place]
    assert math.sqrt(variance) == pytest.approx(read["parameters"]["k3"]["standard_uncertainty"])
    assert read["pixel_pitch_um"] == 4.65
    plain = json.loads(export_json(replace(fit, pixel_pitch_um=None), camera_name="c"))
    assert "pixel_pitch_um" not in plain


def project_published(read, points):
    """Project directions as the manual of the reader writes it [px]."""
    x, y = points.T
    r2 = x**2 + y**2
    radial = 1 + read["k1"] * r2 + read["k2"] * r2**2 + read["k3"] * r2**3
    along = x * radial + read["px"] * (r2 + 2 * x**2) + 2 * read["py"] * x * y
    down = y * radial + read["py"] * (r2 + 2 * y**2) + 2 * read["px"] * x * y
    return np.stack([read["u0"] + read["fu"] * along, read["v0"] + read["fv"] * down], axis=-1)


def read_odm(text, width, height):
    ((name, named),) = json.loads(text).items()
    assert len(name.split(" ")) >= 6, "OpenDroneMap refuses such a name"
    assert (named["projection_type"], named["width"], named["height"]) == ("brown", width, height)
    read = {each: named[each] for each in ("k1", "k2", "k3")} | {"px": named["p2"], "py": named["p1"]}
    side = max(width, height)
    read |= {"fu": side * named["focal_x"], "fv": side * named["focal_y"]}
    middle = (width - 1) / 2, (height - 1) / 2
    return read | {"u0": side * named["c_x"] + middle[0], "v0": side * named["c_y"] + middle[1]}


@pytest.mark.parametrize("size", [(640, 480), (481, 639)])
def test_opendronemap_projects_points_where_the_camera_sees_them(fit, size):
    # a camera in which no two parameters can be taken for each other
    width, height = size
    size_px = {"width_px": width, "height_px": height}
    inner = {"fx_px": 540.0, "fy_px": 531.0, "cx_px": 0.52 * width, "cy_px": 0.474 * height}
    uneven = replace(fit.camera, **size_px, **inner, p1=2e-3, p2=-7e-4)
    (export,) = (each for each in EXPORTS if each.filename == "cameras.json")
    text = export.write(replace(fit, camera=uneven), SUBJECT, {"camera_id": None})
    rows, cols = np.meshgrid(np.linspace(0.0, height - 1.0, 9), np.linspace(0.0, width - 1.0, 12))
    points = find_directions(uneven, np.stack([rows, cols], -1).reshape(-1, 2))
    spatial = np.concatenate([points, np.ones((len(points), 1))], axis=1)
    seen, _ = cv2.projectPoints(spatial, np.zeros(3), np.zeros(3), uneven.matrix, uneven.distortion)
    projected = project_published(read_odm(text, *size), points)
    assert np.linalg.norm(projected - seen.reshape(-1, 2), axis=1).max() < 1e-9


@pytest.mark.parametrize(
    ("changes", "size", "allowed_px"),
    [
        ({"fy_px": 530.0, "cx_px": 319.5, "cy_px": 239.5, "k3": 0.0, "p1": 0.0, "p2": 0.0}, (640, 480), 0.01),
        ({"fy_px": 530.0, "cx_px": 342.3, "cy_px": 235.6, "p1": 0.0, "p2": 0.0}, (640, 480), 0.19),
        ({"fy_px": 530.0, "cx_px": 342.3, "cy_px": 235.6, "p1": 2e-3, "p2": -7e-4}, (640, 480), 1.6),
        ({"fy_px": 530.0, "cx_px": 235.6, "cy_px": 342.3, "p1": 2e-3, "p2": -7e-4}, (481, 639), 2.2),
    ],
)
def test_liblensfun_corrects_by_the_camera(fit, lensfunpy, changes, size, allowed_px):
    width, height = size
    changes = {"width_px": width, "height_px": height} | changes
    camera = replace(fit.camera, fx_px=530.0, k1=-0.27, k2=0.04, **changes)
    (export,) = (each for each in EXPORTS if each.filename == "lensfun-distortion.xml")
    asked = {"focal_length_mm": 15.0, "mount": "canonFixed", "widest_f_number": 1.4}
    text = export.write(replace(fit, camera=camera), SUBJECT, asked)
    database = lensfunpy.Database(xml=text, load_common=False, load_bundled=False)
    (found,) = database.find_cameras("Canon", "EOS 5D")
    (lens,) = database.find_lenses(found, "L", "Lens 15mm f/1.4")
    modifier = lensfunpy.Modifier(lens, found.crop_factor, width, height)
    modifier.initialize(15.0, 4.0, 1000.0, scale=1.0, pixel_format=np.float32)
    seen = modifier.apply_geometry_distortion()[::20, ::20].reshape(-1, 2).astype(float)
    places = np.stack(np.meshgrid(np.arange(0.0 + width), np.arange(0.0 + height)), -1)[::20, ::20].reshape(
        -1, 2
    )
    # the corrected picture may have any focal length and principal point: both are fitted
    directions = find_directions(camera, seen[:, ::-1])
    ones, zeros = np.ones(len(places)), np.zeros(len(places))
    across, down = ([*each] for each in directions.T)
    matrix = np.concatenate([np.stack([across, ones, zeros], -1), np.stack([down, zeros, ones], -1)])
    wanted = places.T.ravel()
    left = (matrix @ np.linalg.lstsq(matrix, wanted, rcond=None)[0] - wanted).reshape(2, -1)
    stated = float(re.search(r"error ([\d.]+) px", text)[1])
    # counted in the corrected picture, whose corners are drawn apart
    assert stated - 0.01 < np.hypot(*left).max() < 2 * stated + 0.01
    assert stated <= allowed_px


def make_picture(camera, kind):
    """A picture whose numbers say which direction a pixel sees: 5000 + 2000 x + 500 y."""
    places = np.stack(np.indices((camera.height_px, camera.width_px)), axis=-1).reshape(-1, 2)
    directions = find_directions(camera, places.astype(np.float64))
    told = 5000.0 + directions @ np.array([2000.0, 500.0])
    return told.reshape(camera.height_px, camera.width_px).astype(kind)


def test_an_undistorted_pixel_shows_its_own_direction():
    plain, inside = undistort(make_picture(SMALL, np.float32), SMALL)
    rows, cols = np.indices(plain.shape)
    expected = 5000 + 2000 * (cols - SMALL.cx_px) / SMALL.fx_px + 500 * (rows - SMALL.cy_px) / SMALL.fy_px
    # between pixels of a curved picture straight lines err by some tenths of 2000 / 130 per pixel
    np.testing.assert_allclose(plain[inside], expected[inside], atol=0.5)
    assert inside.all()


def test_what_no_pixel_saw_is_nothing():
    pincushion = replace(SMALL, k1=0.3, k2=0.0, k3=0.0)
    plain, inside = undistort(make_picture(pincushion, np.float32), pincushion)
    assert 0.5 < inside.mean() < 1.0
    assert not inside[0, 0]
    np.testing.assert_array_equal(np.isnan(plain), ~inside)
    whole, same = undistort(make_picture(pincushion, np.uint16), pincushion)
    np.testing.assert_array_equal(same, inside)
    assert whole.dtype == np.uint16
    assert not whole[~inside].any()
    assert whole[inside].all()


def test_a_lens_without_distortion_changes_nothing():
    straight = replace(SMALL, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0)
    samples = np.random.default_rng(1).integers(0, 65_536, (120, 160, 3), np.uint16)
    plain, inside = undistort(samples, straight)
    np.testing.assert_array_equal(plain[inside], samples[inside])
    assert inside[1:-1, 1:-1].all()


def test_a_picture_of_another_size_is_refused():
    with pytest.raises(
        InputRejected, match="160 x 120 pixels, the calibration holds for 640 x 480"
    ) as caught:
        undistort(make_picture(SMALL, np.uint8), SQUARE)
    assert caught.value.code is shared.WRONG_CAMERA
