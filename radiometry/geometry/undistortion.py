"""A picture as a lens without distortion would have taken it."""

from typing import Final, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.errors import Code, InputRejected
from radiometry.geometry.camera import CameraModel

_Sample = TypeVar("_Sample", np.uint8, np.uint16, np.float32)

# cv2.remap counts in 16 bits.
_LONGEST_SIDE_PX: Final = 32_766


def undistort(samples: NDArray[_Sample], camera: CameraModel) -> tuple[NDArray[_Sample], NDArray[np.bool_]]:
    """Undo the distortion; size, scale and principal point stay the camera's.

    result(row, col) = samples where the model shows the direction ((col - cx)/fx, (row - cy)/fy), by bilinear
    interpolation. What lies outside of the picture is 0 (NaN in float32) and False in the second result: a
    pixel counts as inside when its four neighbours are. Nothing is cropped and nothing made up.

    Takes
      samples : (row, col) or (row, col, 3) of uint8, uint16 or float32, demosaiced: colours are not mixed
    Raises InputRejected(wrong_camera) if the picture has another size than the camera
    """
    height, width = samples.shape[:2]
    if (height, width) != (camera.height_px, camera.width_px):
        raise InputRejected(
            Code.WRONG_CAMERA,
            f"The picture is {width} x {height} pixels, the calibration holds for "
            f"{camera.width_px} x {camera.height_px}. Take a picture of the same size and crop.",
        )
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
