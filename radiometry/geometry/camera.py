"""The camera: its model, its pictures in grey, and what it undoes in them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame import Frame
from radiometry.frame.opencv import cv2

__all__ = ["PARAMETERS", "UNITS", "CameraModel", "find_directions", "project"]

# In OpenCV's order, which is that of covariances too
PARAMETERS: Final = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
UNITS: Final = {name: "px" if name.endswith("_px") else "1" for name in PARAMETERS}
MODEL: Final = "brown_conrady"


@dataclass(frozen=True, kw_only=True)
class CameraModel:
    """Camera by Brown's model [1], in OpenCV's notation.

    Of a point in the camera's frame (x right, y down, z forward)::

        x = X/Z, y = Y/Z, r^2 = x^2 + y^2
        x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
        y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
        col = fx x' + cx,   row = fy y' + cy          the first pixel's centre is (0, 0)

    [1] D. C. Brown, Decentering distortion of lenses, Photogrammetric Engineering 32(3), 1966
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


BINOMIAL: Final = np.array([0.25, 0.5, 0.25])
_DARK_PERCENTILE, _BRIGHT_PERCENTILE = 0.5, 99.5
_PERCENTILE_SAMPLES: Final = 1 << 20


@dataclass(frozen=True)
class Grey:
    """Grey picture in two forms, (row, col)."""

    coarse: NDArray[np.uint8]  # Picture in which a board is searched
    fine: NDArray[np.uint8] | NDArray[np.float32]  # Picture in which corners are placed


def make_grey(frame: Frame, *, bits_per_sample: int) -> Grey:
    """Return the grey picture; the transposed frame gives the transposed picture.

    A mosaic is smoothed by 1/4 [1 2 1] along rows and along columns. Around every pixel, of whatever
    colour, the four sites of its cell then weigh 1/4 each and lie symmetrically: the pattern vanishes and
    no edge moves. Colour pictures are weighted as OpenCV does, .299 R + .587 G + .114 B.

    Pictures of 8 bits are taken as they are. In all others, corners are placed in float32, and boards
    searched in 8 bits that run straight from the 0.5th percentile to the 99.5th.
    """
    samples = frame.samples_dn
    if frame.cfa == "rgb" and bits_per_sample == 8:
        plain = np.asarray(cv2.cvtColor(samples.astype(np.uint8), cv2.COLOR_RGB2GRAY), np.uint8)
        return Grey(plain, plain)
    if frame.cfa == "grey" and bits_per_sample == 8:
        plain = samples.astype(np.uint8)
        return Grey(plain, plain)
    fine = _make_fine(frame)
    return Grey(_stretch(fine), fine)


def _make_fine(frame: Frame) -> NDArray[np.float32]:
    if frame.cfa == "rgb":
        return np.asarray(cv2.cvtColor(frame.samples_dn, cv2.COLOR_RGB2GRAY), np.float32)
    if frame.cfa == "grey":
        return frame.samples_dn.astype(np.float32)
    # the border mirrored about its outermost pixel keeps the pattern's phase
    smooth = cv2.sepFilter2D(
        frame.samples_dn, cv2.CV_32F, BINOMIAL, BINOMIAL, borderType=cv2.BORDER_REFLECT_101
    )
    return np.asarray(smooth, np.float32)


def _stretch(fine: NDArray[np.float32]) -> NDArray[np.uint8]:
    step = max(1, int(np.sqrt(fine.size / _PERCENTILE_SAMPLES)))
    low, high = np.percentile(fine[::step, ::step], (_DARK_PERCENTILE, _BRIGHT_PERCENTILE))
    share = (fine - np.float32(low)) / np.float32(max(high - low, 1.0))
    return np.asarray(np.round(np.clip(share, 0.0, 1.0) * 255.0), np.uint8)


_Sample = TypeVar("_Sample", np.uint8, np.uint16, np.float32)

# cv2.remap counts in 16 bits.
_LONGEST_SIDE_PX: Final = 32_766


@dataclass(frozen=True, kw_only=True)
class Undistorted:
    """Undistorted picture of a frame in raw numbers, black not subtracted."""

    # Samples [DN], (row, col) or (row, col, plane), 0 where the camera did not see
    samples_dn: NDArray[np.uint16]
    planes: tuple[str, ...]  # ("grey",) or ("R", "G", "B")
    seen_share: float  # Fraction of the pixels that the camera saw


def undistort_frame(frame: Frame, camera: CameraModel) -> Undistorted:
    """Compute the undistorted picture of a whole frame.

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
    """Check that a picture has the size of the calibration's."""
    if (height_px, width_px) != (camera.height_px, camera.width_px):
        raise InputRejected(
            shared.WRONG_CAMERA,
            f"The picture is {width_px} x {height_px} pixels, the calibration holds for "
            f"{camera.width_px} x {camera.height_px}. Take a picture of the same size and crop.",
        )


def undistort(samples: NDArray[_Sample], camera: CameraModel) -> tuple[NDArray[_Sample], NDArray[np.bool_]]:
    """Compute the undistorted picture; size, scale and principal point stay the camera's.

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


_RADIAL: Final = {"k1": 3, "k2": 5, "k3": 7}

DISTORTION: Final = frozenset({*_RADIAL, "p1", "p2"})


def move_corner(name: str, means: Mapping[str, float]) -> float:
    """Return the image motion in the frame's corner per unit of a distortion coefficient."""
    try:
        fx, fy, cx, cy = (means[f"{each}_px"] for each in ("fx", "fy", "cx", "cy"))
    except KeyError:
        return math.nan
    x, y = cx / fx, cy / fy
    squared = x * x + y * y
    if name in _RADIAL:
        power = (_RADIAL[name] - 1) / 2
        return float(math.hypot(fx * x, fy * y) * squared**power)
    if name == "p1":
        return math.hypot(fx * 2 * x * y, fy * (squared + 2 * y * y))
    return math.hypot(fx * (squared + 2 * x * x), fy * 2 * x * y)
