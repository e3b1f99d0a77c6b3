"""Exports of a geometry version."""

from typing import Final

from radiometry.frame.lensfun import list_options, name_for_lensfun
from radiometry.geometry.exports import (
    export_colmap,
    export_json,
    export_metashape,
    export_odm,
    export_opencv,
    export_ros,
)
from radiometry.geometry.lensfun import export_lensfun
from radiometry.geometry.pix4d import export_pix4d, export_xmp
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
        filename="ros.yaml",
        label="ROS camera_info",
        media_type="application/yaml",
        operation="get_ros_yaml",
        description="The camera as ROS's camera_info reads it.",
        write=lambda fitted, subject, _: export_ros(fitted, camera_name=_name(subject)),
    ),
    Export(
        filename="cameras.txt",
        label="COLMAP",
        media_type="text/plain",
        operation="get_colmap_cameras",
        description="The camera as COLMAP's cameras.txt, model FULL_OPENCV.",
        write=lambda fitted, *_: export_colmap(fitted),
    ),
    Export(
        filename="metashape.xml",
        label="Metashape",
        media_type="application/xml",
        operation="get_metashape_xml",
        description="The camera as Agisoft Metashape's calibration XML.",
        write=lambda fitted, *_: export_metashape(fitted),
    ),
    Export(
        filename="pix4d.cam",
        label="Pix4D",
        media_type="text/plain",
        operation="get_cam_file",
        description="The camera as Pix4D's calibration file. It has one focal length for both axes; its last "
        "line states the error of that. The pixel pitch must be registered with the camera.",
        write=lambda fitted, subject, _: export_pix4d(fitted.camera, pixel_pitch_um=subject.pitch_um),
        needs_pixel_pitch=True,
    ),
    Export(
        filename="geometry.xmp",
        label="XMP sidecar",
        media_type="application/rdf+xml",
        operation="get_geometry_xmp",
        description="The camera as an XMP sidecar, as MicaSense cameras state it. In Pix4D's namespace: "
        "PrincipalPoint, PerspectiveFocalLength, one for both axes with the error of that in the "
        "description, and PerspectiveDistortion. The pixel pitch must be registered with the camera.",
        write=lambda fitted, subject, _: export_xmp(fitted.camera, pixel_pitch_um=subject.pitch_um),
        needs_pixel_pitch=True,
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
