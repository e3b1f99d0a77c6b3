"""A rig for other programs: OpenCV's YAML, and JSON with covariances."""

import dataclasses
import json
from collections.abc import Sequence
from typing import Final

import numpy as np

from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import PARAMETERS
from radiometry.geometry.exports import quote
from radiometry.geometry.rig.results import RigFit
from radiometry.specification.rig import RigExport, RigMember


def export_opencv(orientation: RigFit, members: Sequence[RigMember], name: str) -> str:
    """Write cameras and orientations for `cv::FileStorage`, numbered as the rig lists them.

    Parameters
    ----------
    orientation : RigFit
        Orientation of the rig.
    members : sequence of RigMember
        Versions, the reference first.
    name : str
        Name of the rig.

    Returns
    -------
    str
        YAML document: serial_i, camera_matrix_i and distortion_coefficients_i of each camera, and R_i and
        T_i [m] with X_i = R_i X_0 + T_i, as `stereoCalibrate` states them.
    """
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


def export_json(orientation: RigFit, members: Sequence[RigMember], name: str) -> str:
    """Write cameras and orientations with their covariances as JSON, the conventions spelt out.

    Parameters
    ----------
    orientation : RigFit
        Orientation of the rig.
    members : sequence of RigMember
        Versions, the reference first.
    name : str
        Name of the rig.
    """
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


EXPORTS: Final = (
    RigExport(
        filename="opencv.yaml",
        label="OpenCV",
        media_type="application/yaml",
        operation="get_rig_opencv_yaml",
        description="Cameras and orientation of the newest set as OpenCV's FileStorage reads them.",
        write=export_opencv,
    ),
    RigExport(
        filename="rig.json",
        label="JSON",
        media_type="application/json",
        operation="get_rig_json",
        description="Cameras and orientation of the newest set with their covariances.",
        write=export_json,
    ),
)
