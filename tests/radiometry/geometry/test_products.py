"""What other programs read, and the undistorted picture."""

import dataclasses
import json
import math
import re
from xml.etree import ElementTree as ET

import cv2
import numpy as np
import pytest
import yaml

from radiometry.findings import InputRejected, shared
from radiometry.geometry import exports, undistortion
from radiometry.geometry import fit as geometry_fit
from radiometry.geometry.camera import find_directions
from radiometry.geometry.exports import _write
from radiometry.geometry.written import EXPORTS
from radiometry.specification.exports import ExportSubject
from tests.radiometry.geometry.boards import CAMERA, FREE, SQUARE

PITCH_MM = 4.65 / 1000.0
SMALL = dataclasses.replace(CAMERA, height_px=120, width_px=160, fx_px=130, fy_px=128, cx_px=83, cy_px=57)


@pytest.fixture(scope="module")
def fit(simulated):
    return geometry_fit.fit_geometry(simulated, dataclasses.replace(FREE, pixel_pitch_um=4.65))


def test_opencv_reads_its_file(fit, tmp_path):
    path = tmp_path / "camera.yml"
    path.write_text(exports.export_opencv(fit), encoding="ascii")
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


def test_ros_reads_its_file(fit):
    text = exports.export_ros(fit, camera_name='FC6520 "two": 0ÄB 😀 ')
    read = yaml.safe_load(text)
    assert list(read) == [
        "image_width",
        "image_height",
        "camera_name",
        "camera_matrix",
        "distortion_model",
        "distortion_coefficients",
        "rectification_matrix",
        "projection_matrix",
    ]
    assert (read["image_width"], read["image_height"]) == (640, 480)
    assert read["camera_name"] == 'FC6520 "two": 0ÄB 😀 '
    assert read["distortion_model"] == "plumb_bob"
    shapes = {
        "camera_matrix": (3, 3),
        "distortion_coefficients": (1, 5),
        "rectification_matrix": (3, 3),
        "projection_matrix": (3, 4),
    }
    for name, (rows, cols) in shapes.items():
        matrix = read[name]
        assert (matrix["rows"], matrix["cols"], len(matrix["data"])) == (rows, cols, rows * cols), name
        assert all(isinstance(value, float) for value in matrix["data"]), name
    assert read["camera_matrix"]["data"] == fit.camera.matrix.ravel().tolist()
    assert read["distortion_coefficients"]["data"] == fit.camera.distortion.tolist()
    assert read["projection_matrix"]["data"][:4] == [fit.camera.fx_px, 0.0, fit.camera.cx_px, 0.0]


@pytest.mark.parametrize("number", [1e-5, -3e-7, 1e300, 0.0, -0.1, 535.9, 1.5e-9])
def test_numbers_are_numbers_in_yaml(number):
    assert yaml.safe_load(_write(number)) == number


def test_json_holds_all_that_the_others_hold(fit):
    read = json.loads(exports.export_json(fit, camera_name="camera"))
    assert {name: each["value"] for name, each in read["parameters"].items()} == {
        each.name: each.value for each in fit.coefficients
    }
    order = read["covariance"]["order"]
    place = order.index("k3")
    variance = read["covariance"]["matrix"][place][place]
    assert math.sqrt(variance) == pytest.approx(read["parameters"]["k3"]["standard_uncertainty"])
    assert read["pixel_pitch_um"] == 4.65
    plain = json.loads(exports.export_json(dataclasses.replace(fit, pixel_pitch_um=None), camera_name="c"))
    assert "pixel_pitch_um" not in plain


def project_published(read, points):
    """Project directions as the manuals of the readers write it, for corners at whole numbers [px]."""
    x, y = points.T
    r2 = x**2 + y**2
    radial = 1 + read["k1"] * r2 + read["k2"] * r2**2 + read["k3"] * r2**3
    along = x * radial + read["px"] * (r2 + 2 * x**2) + 2 * read["py"] * x * y
    down = y * radial + read["py"] * (r2 + 2 * y**2) + 2 * read["px"] * x * y
    return np.stack([read["u0"] + read["fu"] * along, read["v0"] + read["fv"] * down], axis=-1)


def read_colmap(text, width, height):
    (line,) = [line.split() for line in text.splitlines() if not line.startswith("#")]
    assert line[:4] == ["1", "FULL_OPENCV", str(width), str(height)]
    fu, fv, u0, v0, k1, k2, p1, p2, k3, *rational = map(float, line[4:])
    assert rational == [0, 0, 0]
    return {"k1": k1, "k2": k2, "k3": k3, "px": p2, "py": p1, "fu": fu, "fv": fv, "u0": u0, "v0": v0}, 0.5


def read_metashape(text, width, height):
    root = ET.fromstring(text)
    assert (root.tag, root.findtext("projection")) == ("calibration", "frame")
    named = {each.tag: float(each.text) for each in root if each.tag != "projection"}
    assert (named["width"], named["height"]) == (width, height)
    read = {name: named[name] for name in ("k1", "k2", "k3")} | {"px": named["p1"], "py": named["p2"]}
    read |= {"fu": named["f"] + named["b1"], "fv": named["f"]}
    return read | {"u0": width / 2 + named["cx"], "v0": height / 2 + named["cy"]}, 0.5


def read_odm(text, width, height):
    ((name, named),) = json.loads(text).items()
    assert len(name.split(" ")) >= 6, "OpenDroneMap refuses such a name"
    assert (named["projection_type"], named["width"], named["height"]) == ("brown", width, height)
    read = {each: named[each] for each in ("k1", "k2", "k3")} | {"px": named["p2"], "py": named["p1"]}
    side = max(width, height)
    read |= {"fu": side * named["focal_x"], "fv": side * named["focal_y"]}
    middle = (width - 1) / 2, (height - 1) / 2
    return read | {"u0": side * named["c_x"] + middle[0], "v0": side * named["c_y"] + middle[1]}, 0.0


def read_cam(text, width, height):
    """Read Pix4D's file, whose pixels are of 4.65 um."""
    lines = [line.split() for line in text.splitlines() if not line.startswith("#")]
    assert lines.pop(0) == ["Pix4D", "camera", "calibration", "file", "0"]
    named = {name: float(value) for name, value in lines}
    assert f"sensor width of {width * PITCH_MM!r}x{height * PITCH_MM!r}mm" in text
    read = {"k1": named["K1"], "k2": named["K2"], "k3": named["K3"], "px": named["T2"], "py": named["T1"]}
    read |= {"fu": named["F"] / PITCH_MM, "fv": named["F"] / PITCH_MM}
    return read | {"u0": named["Px"] / PITCH_MM, "v0": named["Py"] / PITCH_MM}, 0.5


def read_xmp(text, width, height):
    """Read the sidecar as MicaSense's library does: lengths times the pixels per millimetre."""
    named = {each.tag.partition("}")[2]: each for each in ET.fromstring(text).iter()}
    assert f">{width} x {height} px of 4.65 um" in text
    x, y = (float(each) / PITCH_MM for each in named["PrincipalPoint"].text.split(","))
    assert named["PerspectiveFocalLengthUnits"].text == "mm"
    focal_px = float(named["PerspectiveFocalLength"].text) / PITCH_MM
    k1, k2, k3, p1, p2 = (float(each.text) for each in named["PerspectiveDistortion"][0])
    read = {"k1": k1, "k2": k2, "k3": k3, "px": p2, "py": p1, "fu": focal_px, "fv": focal_px}
    return read | {"u0": x, "v0": y}, 0.0


@pytest.mark.parametrize("size", [(640, 480), (481, 639)])
@pytest.mark.parametrize(
    ("filename", "read"),
    [
        ("cameras.txt", read_colmap),
        ("metashape.xml", read_metashape),
        ("cameras.json", read_odm),
        ("pix4d.cam", read_cam),
        ("geometry.xmp", read_xmp),
    ],
)
def test_other_programs_project_points_where_the_camera_sees_them(fit, filename, read, size):
    subject = ExportSubject(
        calibration_id="cal",
        make="Canon",
        model="EOS 5D",
        serial="1",
        lens_make=None,
        lens_model=None,
        pixel_pitch_um=4.65,
    )
    # a camera in which no two parameters can be taken for each other
    width, height = size
    size_px = {"width_px": width, "height_px": height}
    inner = {"fx_px": 540.0, "fy_px": 531.0, "cx_px": 0.52 * width, "cy_px": 0.474 * height}
    uneven = dataclasses.replace(fit.camera, **size_px, **inner, p1=2e-3, p2=-7e-4)
    (export,) = (each for each in EXPORTS if each.filename == filename)
    text = export.write(dataclasses.replace(fit, camera=uneven), subject, {"camera_id": None})
    rows, cols = np.meshgrid(np.linspace(0.0, height - 1.0, 9), np.linspace(0.0, width - 1.0, 12))
    points = find_directions(uneven, np.stack([rows, cols], -1).reshape(-1, 2))
    spatial = np.concatenate([points, np.ones((len(points), 1))], axis=1)
    seen, _ = cv2.projectPoints(spatial, np.zeros(3), np.zeros(3), uneven.matrix, uneven.distortion)
    named, first_pixel = read(text, *size)
    deviation = np.linalg.norm(project_published(named, points) - first_pixel - seen.reshape(-1, 2), axis=1)
    stated = re.search(r"one focal length: ([\d.]+) px", text)
    assert deviation.max() == pytest.approx(
        float(stated[1]) if stated else 0.0, abs=0.006 if stated else 1e-9
    )


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
    camera = dataclasses.replace(fit.camera, fx_px=530.0, k1=-0.27, k2=0.04, **changes)
    subject = ExportSubject(
        calibration_id="cal",
        make="Canon",
        model="EOS 5D",
        serial="1",
        lens_make="L",
        lens_model="Lens 15mm f/1.4",
        pixel_pitch_um=4.65,
    )
    (export,) = (each for each in EXPORTS if each.filename == "lensfun-distortion.xml")
    asked = {"focal_length_mm": 15.0, "mount": "canonFixed", "widest_f_number": 1.4}
    text = export.write(dataclasses.replace(fit, camera=camera), subject, asked)
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
    plain, inside = undistortion.undistort(make_picture(SMALL, np.float32), SMALL)
    rows, cols = np.indices(plain.shape)
    expected = 5000 + 2000 * (cols - SMALL.cx_px) / SMALL.fx_px + 500 * (rows - SMALL.cy_px) / SMALL.fy_px
    # between pixels of a curved picture straight lines err by some tenths of 2000 / 130 per pixel
    np.testing.assert_allclose(plain[inside], expected[inside], atol=0.5)
    assert inside.all()


def test_what_no_pixel_saw_is_nothing():
    pincushion = dataclasses.replace(SMALL, k1=0.3, k2=0.0, k3=0.0)
    plain, inside = undistortion.undistort(make_picture(pincushion, np.float32), pincushion)
    assert 0.5 < inside.mean() < 1.0
    assert not inside[0, 0]
    np.testing.assert_array_equal(np.isnan(plain), ~inside)
    whole, same = undistortion.undistort(make_picture(pincushion, np.uint16), pincushion)
    np.testing.assert_array_equal(same, inside)
    assert whole.dtype == np.uint16
    assert not whole[~inside].any()
    assert whole[inside].all()


def test_a_lens_without_distortion_changes_nothing():
    straight = dataclasses.replace(SMALL, k1=0.0, k2=0.0, p1=0.0, p2=0.0, k3=0.0)
    samples = np.random.default_rng(1).integers(0, 65_536, (120, 160, 3), np.uint16)
    plain, inside = undistortion.undistort(samples, straight)
    np.testing.assert_array_equal(plain[inside], samples[inside])
    assert inside[1:-1, 1:-1].all()


def test_the_transposed_picture_is_undistorted_alike():
    picture = make_picture(SMALL, np.float32)
    turned = dataclasses.replace(
        SMALL,
        height_px=SMALL.width_px,
        width_px=SMALL.height_px,
        fx_px=SMALL.fy_px,
        fy_px=SMALL.fx_px,
        cx_px=SMALL.cy_px,
        cy_px=SMALL.cx_px,
        p1=SMALL.p2,
        p2=SMALL.p1,
    )
    here, _ = undistortion.undistort(picture, SMALL)
    there, _ = undistortion.undistort(np.ascontiguousarray(picture.T), turned)
    np.testing.assert_allclose(there.T, here, atol=0.3)


def test_a_picture_of_another_size_is_refused():
    with pytest.raises(
        InputRejected, match="160 x 120 pixels, the calibration holds for 640 x 480"
    ) as caught:
        undistortion.undistort(make_picture(SMALL, np.uint8), SQUARE)
    assert caught.value.code is shared.WRONG_CAMERA
