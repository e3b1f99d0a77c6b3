"""Exports of a geometry version."""

from typing import Final

from radiometry.frame.lensfun import list_options, name_for_lensfun
from radiometry.geometry.exports import export_json, export_odm, export_opencv
from radiometry.geometry.lensfun import export_lensfun
from radiometry.geometry.results import Fit
from radiometry.specification.exports import Export, ExportOption, ExportSubject

_CAMERA_ID: Final = (
    "Name of the camera in OpenDroneMap's own cameras.json of such frames; it takes the file for no other. "
    "Without it: make, model, size and focal length over the larger side, which may differ from its own name."
)

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
        filename="cameras.json",
        label="OpenDroneMap",
        media_type="application/json",
        operation="get_odm_cameras",
        description="The camera as OpenDroneMap's cameras.json, model brown.",
        write=lambda fitted, subject, asked: export_odm(
            fitted, camera_id=asked["camera_id"] or _name_for_odm(fitted, subject)
        ),
        options=(ExportOption(name="camera_id", kind="text", description=_CAMERA_ID, required=False),),
    ),
    Export(
        filename="lensfun-distortion.xml",
        label="Lensfun",
        media_type="application/xml",
        operation="get_lensfun_distortion",
        description="The distortion as an entry of Lensfun's database, model poly5. The pixel pitch must be "
        "registered with the camera.",
        write=lambda fitted, subject, asked: export_lensfun(
            fitted.camera,
            names=name_for_lensfun(
                subject, asked, width_px=fitted.camera.width_px, height_px=fitted.camera.height_px
            ),
            widest_f_number=asked["widest_f_number"],
        ),
        options=list_options(needs_widest=True),
        needs_pixel_pitch=True,
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


def _name_for_odm(fitted: Fit, subject: ExportSubject) -> str:
    camera = fitted.camera
    share = camera.fx_px / max(camera.width_px, camera.height_px)
    size = f"{camera.width_px} {camera.height_px}"
    return f"v2 {subject.make} {subject.model} {size} brown {share:.4f}".lower()
