"""A camera for Pix4D, whose model has one focal length for both axes."""

from dataclasses import replace

import numpy as np

from radiometry.frame.xmp import write_sidecar
from radiometry.geometry.camera import CameraModel, find_directions, project

_SAMPLES = 33


def export_pix4d(camera: CameraModel, *, pixel_pitch_um: float) -> str:
    """Write the camera as Pix4D's calibration file, with the ending `.cam`.

    Parameters
    ----------
    camera : CameraModel
        Camera of one version.
    pixel_pitch_um : float
        Pixel pitch of the sensor [um], which turns pixels into the file's millimetres.

    Notes
    -----
    Pix4D's perspective lens [1]_ has OpenCV's order and signs, T1 and T2 being p1 and p2. The principal point
    counts from the frame's top left corner, as in the files that Pix4D writes beside its camera matrices;
    where in a pixel it counts from is not published, so that it may be off by half a pixel. The last line
    states the largest error of the one focal length, the mean of fx and fy.

    References
    ----------
    .. [1] Pix4D, "How are the Internal and External Camera Parameters defined?"
    """
    common, error_px = use_one_focal_length(camera)
    pitch_mm = pixel_pitch_um / 1000.0
    size = f"{camera.width_px * pitch_mm!r}x{camera.height_px * pitch_mm!r}mm"
    lines = [
        "Pix4D camera calibration file 0",
        f"#Focal Length mm assuming a sensor width of {size}",
        f"F {common.fx_px * pitch_mm!r}",
        "#Principal Point mm",
        f"Px {(camera.cx_px + 0.5) * pitch_mm!r}",
        f"Py {(camera.cy_px + 0.5) * pitch_mm!r}",
        "#Symmetrical Lens Distortion Coeffs",
        f"K1 {camera.k1!r}",
        f"K2 {camera.k2!r}",
        f"K3 {camera.k3!r}",
        "#Tangential Lens Distortion Coeffs",
        f"T1 {camera.p1!r}",
        f"T2 {camera.p2!r}",
        f"#Largest error of one focal length: {error_px:.2f} px",
    ]
    return "\n".join(lines) + "\n"


def export_xmp(camera: CameraModel, *, pixel_pitch_um: float) -> str:
    """Write the camera as an XMP sidecar in Pix4D's namespace, as MicaSense cameras state their lenses.

    Parameters
    ----------
    camera : CameraModel
        Camera of one version.
    pixel_pitch_um : float
        Pixel pitch of the sensor [um].

    Notes
    -----
    PerspectiveDistortion is k1, k2, k3, p1, p2. PrincipalPoint [mm] counts from the first pixel's centre, x
    right and y down, as MicaSense's image processing library [1]_ takes it into OpenCV's camera matrix; that
    library takes the pixels per millimetre from the image's own FocalPlaneXResolution.

    References
    ----------
    .. [1] MicaSense imageprocessing, `Image.cv2_camera_matrix` and `Image.cv2_distortion_coeff`
    """
    common, error_px = use_one_focal_length(camera)
    pitch_mm = pixel_pitch_um / 1000.0
    return write_sidecar(
        {
            "ModelType": "perspective",
            "PrincipalPoint": f"{camera.cx_px * pitch_mm!r},{camera.cy_px * pitch_mm!r}",
            "PerspectiveFocalLength": repr(common.fx_px * pitch_mm),
            "PerspectiveFocalLengthUnits": "mm",
            "PerspectiveDistortion": (camera.k1, camera.k2, camera.k3, camera.p1, camera.p2),
        },
        description=f"{camera.width_px} x {camera.height_px} px of {pixel_pitch_um!r} um; principal point "
        f"from the first pixel's centre; largest error of one focal length: {error_px:.2f} px",
    )


def use_one_focal_length(camera: CameraModel) -> tuple[CameraModel, float]:
    """Return the camera with the mean of its focal lengths, and its largest error over the frame [px]."""
    focal_px = (camera.fx_px + camera.fy_px) / 2.0
    common = replace(camera, fx_px=focal_px, fy_px=focal_px)
    lattice = np.meshgrid(
        np.linspace(0.0, camera.height_px - 1.0, _SAMPLES), np.linspace(0.0, camera.width_px - 1.0, _SAMPLES)
    )
    directions = find_directions(camera, np.stack(lattice, axis=-1).reshape(-1, 2))
    spatial = np.column_stack((directions, np.ones(len(directions))))
    still = np.zeros(3)
    missed = project(common, spatial, still, still) - project(camera, spatial, still, still)
    return common, float(np.linalg.norm(missed, axis=1).max())
