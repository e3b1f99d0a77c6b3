"""Picture as a lens without distortion would have taken it."""

from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame import Frame
from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import CameraModel
from radiometry.geometry.grey import make_grey

_Sample = TypeVar("_Sample", np.uint8, np.uint16, np.float32)

# cv2.remap counts in 16 bits.
_LONGEST_SIDE_PX: Final = 32_766


@dataclass(frozen=True, kw_only=True)
class Undistorted:
    """Undistorted picture of a frame in raw numbers, black not subtracted.

    Attributes
    ----------
    samples_dn : ndarray of uint16
        Samples [DN], (row, col) or (row, col, plane), 0 where the camera did not see.
    planes : tuple of str
        ("grey",) or ("R", "G", "B").
    seen_share : float
        Fraction of the pixels that the camera saw.
    """

    samples_dn: NDArray[np.uint16]
    planes: tuple[str, ...]
    seen_share: float


def undistort_frame(frame: Frame, camera: CameraModel) -> Undistorted:
    """Compute the undistorted picture of a whole frame.

    Parameters
    ----------
    frame : Frame
        Whole frame.
    camera : CameraModel
        Camera model.

    Raises
    ------
    InputRejected
        `wrong_camera` if the picture has another size than the camera.

    Notes
    -----
    A rendered colour picture keeps its planes. A mosaic becomes one grey plane, in which the four sites of
    its pattern weigh a quarter each around every pixel: the picture in which the calibration places
    corners.
    """
    planes: tuple[str, ...] = ("grey",)
    if frame.cfa == "rgb":
        samples, planes = frame.samples_dn, ("R", "G", "B")
    else:
        fine = make_grey(frame, bits_per_sample=16).fine
        samples = np.rint(fine).astype(np.uint16)
    moved, seen = undistort(samples, camera)
    return Undistorted(samples_dn=moved, planes=planes, seen_share=float(np.mean(seen)))


def require_size(camera: CameraModel, *, height_px: int, width_px: int) -> None:
    """Check that a picture has the size of the calibration's.

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    height_px, width_px : int
        Size of the picture [px].

    Raises
    ------
    InputRejected
        `wrong_camera` if it has another size.
    """
    if (height_px, width_px) != (camera.height_px, camera.width_px):
        raise InputRejected(
            shared.WRONG_CAMERA,
            f"The picture is {width_px} x {height_px} pixels, the calibration holds for "
            f"{camera.width_px} x {camera.height_px}. Take a picture of the same size and crop.",
        )


def undistort(samples: NDArray[_Sample], camera: CameraModel) -> tuple[NDArray[_Sample], NDArray[np.bool_]]:
    """Compute the undistorted picture; size, scale and principal point stay the camera's.

    Parameters
    ----------
    samples : ndarray of _Sample
        Samples, (row, col) or (row, col, 3) of uint8, uint16 or float32, demosaiced:
        colours are not mixed.
    camera : CameraModel
        Camera model.

    Returns
    -------
    tuple of (ndarray of _Sample, ndarray of bool)
        Samples, and True for each pixel that the camera saw.

    Raises
    ------
    InputRejected
        `wrong_camera` if the picture has another size than the camera.

    Notes
    -----
    result(row, col) = samples where the model shows the direction ((col - cx)/fx, (row - cy)/fy), by
    bilinear interpolation. What lies outside of the picture is 0 (NaN in float32) and False in the second
    result: a pixel counts as inside when its four neighbours are. Nothing is cropped and nothing is made
    up.
    """
    height, width = samples.shape[:2]
    require_size(camera, height_px=height, width_px=width)
    if max(height, width) > _LONGEST_SIDE_PX:
        raise ValueError(f"a side of more than {_LONGEST_SIDE_PX} px")
    cols, rows = cv2.initUndistortRectifyMap(
        camera.matrix, camera.distortion, np.eye(3), camera.matrix, (width, height), cv2.CV_32FC1
    )
    inside = (rows >= 0.0) & (rows <= height - 1) & (cols >= 0.0) & (cols <= width - 1)
    moved = cv2.remap(samples, cols, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    result = np.asarray(moved, samples.dtype)
    result[~inside] = np.nan if samples.dtype == np.float32 else 0
    return result, np.asarray(inside, np.bool_)
