"""A version, or a rig, in the forms that other programs read."""

import dataclasses
import json
import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import scipy
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import PARAMETERS, CameraModel, project
from radiometry.geometry.results import Fit
from radiometry.geometry.rig.adjustment import RigFit
from radiometry.specification import exports


def export_opencv(fit: Fit) -> str:
    """Write the file that OpenCV's calibration sample writes, for `cv::FileStorage`.

    It contains camera_matrix (3, 3) and distortion_coefficients (1, 5: k1, k2, p1, p2, k3), the size of the
    frame, the board, and the errors of the views that were used.
    """
    storage = cv2.FileStorage("camera.yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("nframes", fit.views)
    storage.write("image_width", fit.camera.width_px)
    storage.write("image_height", fit.camera.height_px)
    storage.write("board_width", fit.target.corner_columns)
    storage.write("board_height", fit.target.corner_rows)
    storage.write("square_size", fit.target.square_size_mm)
    storage.write("camera_matrix", fit.camera.matrix)
    storage.write("distortion_coefficients", fit.camera.distortion.reshape(1, -1))
    storage.write("avg_reprojection_error", fit.rms_px)
    errors = [point.rms_px for point in fit.points if point.used and point.rms_px is not None]
    storage.write("per_view_reprojection_errors", np.array(errors).reshape(-1, 1))
    text: str = storage.releaseAndGetString()
    return text


def quote(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


def export_json(fit: Fit, *, camera_name: str) -> str:
    """Write camera, standard uncertainties and covariance as JSON, with the model spelt out."""
    values = {
        each.name: {"value": each.value, "standard_uncertainty": each.standard_uncertainty, "unit": each.unit}
        for each in fit.coefficients
    }
    content = {
        "camera_name": camera_name,
        "model": fit.model,
        "convention": "first pixel's centre is (0, 0), x right, y down; OpenCV's order and signs",
        "image_width_px": fit.camera.width_px,
        "image_height_px": fit.camera.height_px,
        "parameters": values,
        "covariance": {"order": list(PARAMETERS), "matrix": fit.covariance},
        "views": fit.views,
        "corners": fit.corners,
        "pixel_pitch_um": fit.pixel_pitch_um,
    }
    stated = {name: value for name, value in content.items() if value is not None}
    return json.dumps(stated, indent=2, allow_nan=False) + "\n"


def export_odm(fit: Fit, *, camera_id: str) -> str:
    """Write the camera as OpenDroneMap's cameras.json, for its option `cameras`.

    OpenSfM's model "brown" [1] has OpenCV's signs. Focal lengths and principal point are in parts of the
    larger side, the latter from the middle of the frame, which is at ((w - 1) / 2, (h - 1) / 2).

    [1] OpenSfM documentation, "Geometric Models"
    """
    camera = fit.camera
    side = max(camera.width_px, camera.height_px)
    content = {
        "projection_type": "brown",
        "width": camera.width_px,
        "height": camera.height_px,
        "focal_x": camera.fx_px / side,
        "focal_y": camera.fy_px / side,
        "c_x": (camera.cx_px - (camera.width_px - 1) / 2) / side,
        "c_y": (camera.cy_px - (camera.height_px - 1) / 2) / side,
        **{name: getattr(camera, name) for name in ("k1", "k2", "p1", "p2", "k3")},
    }
    return json.dumps({camera_id: content}, indent=2, allow_nan=False) + "\n"


_SAMPLES = 33


def export_lensfun(camera: CameraModel, *, names: exports.LensfunNames, widest_f_number: float) -> str:
    """Write a Lensfun database with the camera, the lens, its centre and its distortion.

    Model "poly5" leads from the corrected to the seen radius [1], both about the lens's centre::

        r_seen = r (1 + k1 r^2 + k2 r^4),  r = 1 at half the diagonal over sqrt(aspect^2 + 1)

    where the diagonal runs between the centres of corner pixels. The centre counts from the frame's middle in
    the same unit; liblensfun 0.3.4 reads it, though the schema of its database has none. Lensfun has neither
    k3, tangential terms nor two focal lengths: k1 and k2 are fitted over the frame, together with the focal
    length and principal point of the corrected picture, which are free. A comment states the largest error.

    [1] Lensfun manual, "Lens calibration data format" and "Corrections"
    """
    middle, unit_px = _find_frame(camera)
    centre = (np.array((camera.cx_px, camera.cy_px)) - middle) / unit_px
    (k1, k2), error_px = _fit_terms(camera)
    terms = f'model="poly5" focal="{names.focal_length_mm:.9g}" k1="{k1:.9g}" k2="{k2:.9g}"'
    return exports.write_database(
        names,
        [f"            <!-- largest error {error_px:.2f} px -->", f"            <distortion {terms}/>"],
        centre=(float(centre[0]), float(centre[1])),
        width_px=camera.width_px,
        height_px=camera.height_px,
        widest_f_number=widest_f_number,
    )


def _fit_terms(camera: CameraModel) -> tuple[tuple[float, float], float]:
    """Return k1 and k2, and the largest error over what the corrected picture shows of the frame [px]."""
    middle, unit_px = _find_frame(camera)
    centre = np.array((camera.cx_px, camera.cy_px))
    lattice = np.meshgrid(*(np.linspace(0.0, 2.0 * half, _SAMPLES) for half in middle))
    places = np.stack(lattice, axis=-1).reshape(-1, 2) - centre
    squared = np.sum(np.square(places / unit_px), axis=1, keepdims=True)

    def see(focal_px: float, shift_px: NDArray[np.float64]) -> NDArray[np.float64]:
        directions = np.column_stack(((places - shift_px) / focal_px, np.ones(len(places))))
        return project(camera, directions, np.zeros(3), np.zeros(3))[:, ::-1]

    seen = see(camera.fx_px, np.zeros(2))
    inside = np.all((seen >= 0.0) & (seen <= 2.0 * middle), axis=1)

    def miss(values: NDArray[np.float64]) -> NDArray[np.float64]:
        k1, k2, focal, *shift = values
        shown = centre + places * (1.0 + squared * (k1 + squared * k2))
        wanted = see(focal * camera.fx_px, unit_px * np.array(shift))
        return np.asarray((shown - wanted)[inside], np.float64)

    found = scipy.optimize.least_squares(lambda values: miss(values).ravel(), (0.0, 0.0, 1.0, 0.0, 0.0)).x
    error_px = float(np.linalg.norm(miss(found), axis=1).max())
    return (float(found[0]), float(found[1])), error_px


def _find_frame(camera: CameraModel) -> tuple[NDArray[np.float64], float]:
    """Return the middle (x, y) of the frame [px], and the radius that is 1 for Lensfun [px]."""
    size = np.array((camera.width_px, camera.height_px), np.float64)
    aspect = float(size.max() / size.min())
    return (size - 1.0) / 2.0, float(np.linalg.norm(size - 1.0)) / 2.0 / math.hypot(aspect, 1.0)


_CAMERA_ID: Final = (
    "Name of the camera in OpenDroneMap's own cameras.json of such frames; it takes the file for no other. "
    "Without it: make, model, size and focal length over the larger side, which may differ from its own name."
)

EXPORTS: Final = (
    exports.Export(
        filename="opencv.yaml",
        label="OpenCV",
        media_type="application/yaml",
        operation="get_opencv_yaml",
        description="The camera as OpenCV's FileStorage reads it.",
        write=lambda fitted, *_: export_opencv(fitted),
    ),
    exports.Export(
        filename="cameras.json",
        label="OpenDroneMap",
        media_type="application/json",
        operation="get_odm_cameras",
        description="The camera as OpenDroneMap's cameras.json, model brown.",
        write=lambda fitted, subject, asked: export_odm(
            fitted, camera_id=asked["camera_id"] or _name_for_odm(fitted, subject)
        ),
        options=(
            exports.ExportOption(name="camera_id", kind="text", description=_CAMERA_ID, required=False),
        ),
    ),
    exports.Export(
        filename="lensfun-distortion.xml",
        label="Lensfun",
        media_type="application/xml",
        operation="get_lensfun_distortion",
        description="The distortion as an entry of Lensfun's database, model poly5. The pixel pitch must be "
        "registered with the camera.",
        write=lambda fitted, subject, asked: export_lensfun(
            fitted.camera,
            names=exports.name_for_lensfun(
                subject, asked, width_px=fitted.camera.width_px, height_px=fitted.camera.height_px
            ),
            widest_f_number=asked["widest_f_number"],
        ),
        options=exports.list_options(needs_widest=True),
        needs_pixel_pitch=True,
    ),
    exports.Export(
        filename="camera.json",
        label="JSON with covariance",
        media_type="application/json",
        operation="get_camera_json",
        description="The camera with its uncertainties and their covariance.",
        write=lambda fitted, subject, _: export_json(
            fitted, camera_name=f"{subject.make} {subject.model} {subject.serial}"
        ),
    ),
)


def _name_for_odm(fitted: Fit, subject: exports.ExportSubject) -> str:
    camera = fitted.camera
    share = camera.fx_px / max(camera.width_px, camera.height_px)
    size = f"{camera.width_px} {camera.height_px}"
    return f"v2 {subject.make} {subject.model} {size} brown {share:.4f}".lower()


def export_rig_opencv(orientation: RigFit, members: Sequence[exports.RigMember], name: str) -> str:
    """Write cameras and orientations for `cv::FileStorage`, numbered as the rig lists them."""
    storage = cv2.FileStorage("rig.yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("cameras", len(members))
    poses = {pose.camera: pose for pose in orientation.poses}
    for number, member in enumerate(members):
        camera = member.fitted.camera
        storage.write(f"image_width_{number}", camera.width_px)
        storage.write(f"image_height_{number}", camera.height_px)
        storage.write(f"camera_matrix_{number}", camera.matrix)
        storage.write(f"distortion_coefficients_{number}", camera.distortion.reshape(1, -1))
        pose = poses.get(member.serial)
        storage.write(f"R_{number}", np.array(pose.matrix) if pose else np.eye(3))
        storage.write(f"T_{number}", np.reshape(pose.translation_m if pose else (0.0,) * 3, (3, 1)))
        if pose:
            storage.write(f"covariance_{number}", np.array(pose.covariance))
    # FileStorage would write null or a space at the end bare, and nobody reads those back as text
    texts = {"rig": name} | {f"serial_{number}": member.serial for number, member in enumerate(members)}
    head, rule, rest = storage.releaseAndGetString().partition("---\n")
    return head + rule + "".join(f"{key}: {quote(text)}\n" for key, text in texts.items()) + rest


def export_rig_json(orientation: RigFit, members: Sequence[exports.RigMember], name: str) -> str:
    """Write cameras and orientations with their covariances as JSON, the conventions spelt out."""
    content = {
        "rig": name,
        "reference": orientation.reference,
        "convention": "X_camera = R X_reference + t, x right, y down, z forward; R = Rodrigues(rotation); "
        "the camera's axes in the reference's frame are Ry(yaw) Rx(pitch) Rz(roll); covariance of "
        "rotation [rad] and t [m]",
        "cameras": [
            {
                "serial": member.serial,
                "image_width_px": member.fitted.camera.width_px,
                "image_height_px": member.fitted.camera.height_px,
                "parameters": dict(zip(PARAMETERS, member.fitted.camera.parameters.tolist(), strict=True)),
                "covariance": {"order": list(PARAMETERS), "matrix": member.fitted.covariance},
            }
            for member in members
        ],
        "orientations": [dataclasses.asdict(pose) for pose in orientation.poses],
    }
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


RIG_EXPORTS: Final = (
    exports.RigExport(
        filename="opencv.yaml",
        label="OpenCV",
        media_type="application/yaml",
        operation="get_rig_opencv_yaml",
        description="Cameras and orientation of the newest set as OpenCV's FileStorage reads them.",
        write=export_rig_opencv,
    ),
    exports.RigExport(
        filename="rig.json",
        label="JSON",
        media_type="application/json",
        operation="get_rig_json",
        description="Cameras and orientation of the newest set with their covariances.",
        write=export_rig_json,
    ),
)
