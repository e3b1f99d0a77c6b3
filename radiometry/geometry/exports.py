"""A camera for other programs, each in its own convention."""

import json

import numpy as np

from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import PARAMETERS
from radiometry.geometry.results import Fit


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
