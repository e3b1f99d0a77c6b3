"""Camera model: where a direction appears in the picture."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.frame.opencv import cv2

PARAMETERS: Final = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
"""In OpenCV's order, which is that of covariances too."""
UNITS: Final = {name: "px" if name.endswith("_px") else "1" for name in PARAMETERS}
MODEL: Final = "brown_conrady"


@dataclass(frozen=True, kw_only=True)
class CameraModel:
    """Camera by Brown's model [1]_, in OpenCV's notation.

    Of a point in the camera's frame (x right, y down, z forward)::

        x = X/Z, y = Y/Z, r^2 = x^2 + y^2
        x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
        y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
        col = fx x' + cx,   row = fy y' + cy          the first pixel's centre is (0, 0)

    References
    ----------
    .. [1] D. C. Brown, Decentering distortion of lenses, Photogrammetric Engineering 32(3),
       1966
    """

    height_px: int
    width_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    k1: float = 0.0
    k2: float = 0.0
    p1: float = 0.0
    p2: float = 0.0
    k3: float = 0.0

    @classmethod
    def from_parameters(cls, values: NDArray[np.float64], *, height_px: int, width_px: int) -> "CameraModel":
        """Return the camera of parameters in the order of PARAMETERS.

        Parameters
        ----------
        values : ndarray of float64
            Parameters in the order of PARAMETERS, (9,).
        height_px, width_px : int
            Size of the picture [px].
        """
        named = dict(zip(PARAMETERS, (float(value) for value in values), strict=True))
        return cls(height_px=height_px, width_px=width_px, **named)

    @property
    def parameters(self) -> NDArray[np.float64]:
        """The parameters in the order of PARAMETERS."""
        return np.array([getattr(self, name) for name in PARAMETERS])

    @property
    def matrix(self) -> NDArray[np.float64]:
        """OpenCV's camera matrix."""
        return np.array([[self.fx_px, 0.0, self.cx_px], [0.0, self.fy_px, self.cy_px], [0.0, 0.0, 1.0]])

    @property
    def distortion(self) -> NDArray[np.float64]:
        """OpenCV's distortion coefficients: k1, k2, p1, p2, k3."""
        return np.array([self.k1, self.k2, self.p1, self.p2, self.k3])

    @property
    def centre_px(self) -> tuple[float, float]:
        """The middle of the picture, (row, col)."""
        return (self.height_px - 1) / 2.0, (self.width_px - 1) / 2.0


def project(
    camera: CameraModel,
    points_mm: NDArray[np.float64],
    rotation: NDArray[np.float64],
    shift: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Compute where points of a board appear.

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    points_mm : ndarray of float64
        Points on the board [mm], (point, 3).
    rotation : ndarray of float64
        Rodrigues vector, (3,).
    shift : ndarray of float64
        Shift [mm], (3,).

    Returns
    -------
    ndarray of float64
        Places in the picture [px], (point, 2), row before col.
    """
    seen, _ = cv2.projectPoints(points_mm, rotation, shift, camera.matrix, camera.distortion)
    return np.asarray(seen, np.float64).reshape(-1, 2)[:, ::-1]


def find_directions(camera: CameraModel, places_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the directions that places in the picture see.

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    places_px : ndarray of float64
        Places [px], (place, 2), row before col.

    Returns
    -------
    ndarray of float64
        Directions, (place, 2), x and y at unit distance.
    """
    seen = np.ascontiguousarray(places_px[:, ::-1]).reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    ideal = cv2.undistortPoints(seen, camera.matrix, camera.distortion, criteria=stop)
    return np.asarray(ideal, np.float64).reshape(-1, 2)
