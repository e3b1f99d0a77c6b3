"""A rig for other programs: OpenCV's YAML, ROS's files, and JSON with covariances."""

import dataclasses
import io
import json
import re
import zipfile
from collections.abc import Sequence
from typing import Final

import numpy as np
import scipy

from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import PARAMETERS
from radiometry.geometry.exports import export_ros, quote
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


def export_ros_files(orientation: RigFit, members: Sequence[RigMember], name: str) -> bytes:
    """Write a ZIP file with the camera_info file of each camera and their transforms, for ROS.

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
    bytes
        ZIP file: camera_info/<frame>.yaml of each camera, and static_transforms.yaml, a list of
        geometry_msgs/TransformStamped from the reference to each other camera: the translation [m] is the
        camera's centre in the reference's frame, the quaternion turns the camera's axes into the reference's.
        Frames are optical: x right, y down, z forward.
    """
    frames = {each.serial: f"camera_{re.sub('[^A-Za-z0-9_]', '_', each.serial)}" for each in members}
    files = {
        f"camera_info/{frames[each.serial]}.yaml": export_ros(each.fitted, camera_name=frames[each.serial])
        for each in members
    }
    transforms = [
        {
            "header": {"frame_id": frames[orientation.reference]},
            "child_frame_id": frames[pose.camera],
            "transform": {
                "translation": {axis: getattr(pose, axis).value for axis in "xyz"},
                "rotation": dict(zip("xyzw", _turn_back(pose.matrix), strict=True)),
            },
        }
        for pose in orientation.poses
    ]
    # JSON is YAML, but for numbers such as 1e-05, which YAML 1.1 takes for text
    text = re.sub(r"(?<![\d.])(\d+)e", r"\1.0e", json.dumps(transforms, indent=2))
    files["static_transforms.yaml"] = f"# rig {json.dumps(name)}\n{text}\n"
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for path, text in files.items():
            archive.writestr(zipfile.ZipInfo(path), text)
    return packed.getvalue()


def _turn_back(matrix: tuple[tuple[float, ...], ...]) -> list[float]:
    quaternion: list[float] = (
        scipy.spatial.transform.Rotation.from_matrix(np.transpose(matrix)).as_quat(canonical=True).tolist()
    )
    return quaternion


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
    RigExport(
        filename="ros.zip",
        label="ROS",
        media_type="application/zip",
        operation="get_rig_ros_zip",
        description="Each camera's camera_info YAML and the static transforms of the newest set, for ROS.",
        write=export_ros_files,
    ),
)
