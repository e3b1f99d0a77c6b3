"""Exports of a geometry version."""

from typing import Final

from radiometry.geometry.exports import export_json, export_opencv, export_ros
from radiometry.specification.exports import Export, ExportSubject

EXPORTS: Final = (
    Export(
        filename="opencv.yaml",
        label="OpenCV",
        media_type="application/yaml",
        operation="get_opencv_yaml",
        description="The camera as OpenCV's FileStorage reads it.",
        write=lambda fitted, *_: export_opencv(fitted),
    ),
    Export(
        filename="ros.yaml",
        label="ROS camera_info",
        media_type="application/yaml",
        operation="get_ros_yaml",
        description="The camera as ROS's camera_info reads it.",
        write=lambda fitted, subject, _: export_ros(fitted, camera_name=_name(subject)),
    ),
    Export(
        filename="camera.json",
        label="JSON with covariance",
        media_type="application/json",
        operation="get_camera_json",
        description="The camera with its uncertainties and their covariance.",
        write=lambda fitted, subject, _: export_json(fitted, camera_name=_name(subject)),
    ),
)


def _name(subject: ExportSubject) -> str:
    return f"{subject.make} {subject.model} {subject.serial}"
