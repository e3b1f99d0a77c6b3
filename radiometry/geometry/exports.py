"""A camera for other programs, each in its own convention."""

import json
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import PARAMETERS
from radiometry.geometry.results import Fit

_ROS_MODEL: Final = "plumb_bob"


def export_opencv(fit: Fit) -> str:
    """Write the file that OpenCV's calibration sample writes, for `cv::FileStorage`.

    Notes
    -----
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
    """Return a text as YAML states it, for readers of any version.

    Parameters
    ----------
    text : str
        Text.

    Returns
    -------
    str
        The text in double quotes, with its letters as they are.
    """
    return json.dumps(text, ensure_ascii=False)


def export_ros(fit: Fit, *, camera_name: str) -> str:
    """Write the file that ROS's camera_calibration_parsers reads into a sensor_msgs/CameraInfo.

    Notes
    -----
    The rectification is the identity and the projection the camera's own matrix: one camera, whose
    undistorted picture keeps its scale.
    """
    camera = fit.camera
    projection = np.hstack([camera.matrix, np.zeros((3, 1))])
    lines = [
        f"image_width: {camera.width_px}",
        f"image_height: {camera.height_px}",
        f"camera_name: {quote(camera_name)}",
        *_write_matrix("camera_matrix", camera.matrix),
        f"distortion_model: {_ROS_MODEL}",
        *_write_matrix("distortion_coefficients", camera.distortion.reshape(1, -1)),
        *_write_matrix("rectification_matrix", np.eye(3)),
        *_write_matrix("projection_matrix", projection),
    ]
    return "\n".join(lines) + "\n"


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


def export_colmap(fit: Fit) -> str:
    """Write the camera as COLMAP's cameras.txt.

    Notes
    -----
    Model FULL_OPENCV [1]_ has OpenCV's order and signs, here with k4, k5 and k6 of zero. COLMAP has the
    centre of the first pixel at (0.5, 0.5), not (0, 0): half a pixel is added to the principal point.

    References
    ----------
    .. [1] COLMAP documentation, "Camera Models" and "Output Format"
    """
    camera = fit.camera
    inner = (camera.fx_px, camera.fy_px, camera.cx_px + 0.5, camera.cy_px + 0.5)
    numbers = (*inner, *camera.distortion.tolist(), 0.0, 0.0, 0.0)
    return (
        "# Camera list with one line of data per camera:\n"
        "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
        f"1 FULL_OPENCV {camera.width_px} {camera.height_px} {' '.join(map(repr, numbers))}\n"
    )


def export_metashape(fit: Fit) -> str:
    """Write the camera as Agisoft Metashape's calibration XML.

    Notes
    -----
    Metashape's frame camera [1]_ is u = w / 2 + cx + x' (f + b1), v = h / 2 + cy + y' f, with
    x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 x^2) + 2 p2 x y: f is fy, b1 is fx - fy, and OpenCV's
    p1 and p2 change places. The centre of the first pixel is (0.5, 0.5); cx and cy count from the middle.

    References
    ----------
    .. [1] Agisoft Metashape User Manual, appendix "Camera models"
    """
    camera = fit.camera
    values = {
        "f": camera.fy_px,
        "cx": camera.cx_px + 0.5 - camera.width_px / 2,
        "cy": camera.cy_px + 0.5 - camera.height_px / 2,
        "b1": camera.fx_px - camera.fy_px,
        "k1": camera.k1,
        "k2": camera.k2,
        "k3": camera.k3,
        "p1": camera.p2,
        "p2": camera.p1,
    }
    size = {"width": camera.width_px, "height": camera.height_px}
    lines = [f"  <{name}>{value!r}</{name}>" for name, value in (size | values).items()]
    head = ['<?xml version="1.0" encoding="UTF-8"?>', "<calibration>", "  <projection>frame</projection>"]
    return "\n".join([*head, *lines, "</calibration>"]) + "\n"


def export_odm(fit: Fit, *, camera_id: str) -> str:
    """Write the camera as OpenDroneMap's cameras.json, for its option `cameras`.

    Notes
    -----
    OpenSfM's model "brown" [1]_ has OpenCV's signs. Focal lengths and principal point are in parts of the
    larger side, the latter from the middle of the frame, which is at ((w - 1) / 2, (h - 1) / 2).

    References
    ----------
    .. [1] OpenSfM documentation, "Geometric Models"
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


def _write_matrix(name: str, matrix: NDArray[np.float64]) -> list[str]:
    rows, cols = matrix.shape
    return [f"{name}:", f"  rows: {rows}", f"  cols: {cols}", f"  data: [{_join(matrix.ravel().tolist())}]"]


def _join(numbers: Sequence[float]) -> str:
    return ", ".join(_write(number) for number in numbers)


def _write(number: float) -> str:
    """Write a number so that it reads back to the last bit, as a number: YAML 1.1 takes 1e-05 for text."""
    text = repr(number)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text
