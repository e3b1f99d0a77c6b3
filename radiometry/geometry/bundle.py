"""The camera and the boards' poses that fit the corners best: a bundle adjustment.

Its own least squares, since OpenCV's takes corners in single precision and states no covariance; it also
gives other last digits with other numbers of threads. On OpenCV's own set the two agree to eleven digits,
standard errors to eight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import PARAMETERS, CameraModel
from radiometry.geometry.descent import TOLERANCE_REL, Linear, Minimum, minimise, reduce

# Beyond it a parameter is not found by these views, whatever the arithmetic still returns.
_WORST_CONDITION: Final = 1e14
# Of the frame's longer side: a fisheye lens has a third, the longest telephoto lens fifty times.
_PLAUSIBLE_FOCAL: Final = (0.1, 200.0)
# A principal distance that is known no better is not known: it has run away with the boards' distances.
_WORST_FOCAL_REL: Final = 0.1
_POSE: Final = 6

_ADVICE = (
    "The views do not determine the camera: take some with the board tilted 20 to 45 degrees, about more "
    "than one axis, and in all parts of the frame."
)


@dataclass(frozen=True)
class View:
    """Corners of one picture.

    Attributes
    ----------
    points_mm : ndarray of float64
        Corners on the board [mm], (corner, 3).
    seen_px : ndarray of float64
        Corners in the picture [px], (corner, 2), row before col.
    """

    points_mm: NDArray[np.float64]
    seen_px: NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """Where a board is: Rodrigues vector and shift [mm], from the board's frame into the camera's."""

    rotation: NDArray[np.float64]
    shift: NDArray[np.float64]

    @property
    def vector(self) -> NDArray[np.float64]:
        """Rodrigues vector and shift, (6,)."""
        return np.concatenate((self.rotation, self.shift))


@dataclass(frozen=True)
class FreeParameters:
    """Free parameters of the camera: its nine are `directions` times the free ones, or zero.

    Attributes
    ----------
    directions : ndarray of float64
        Directions, (9, free); with square pixels fx and fy are one free parameter.
    """

    directions: NDArray[np.float64]


@dataclass(frozen=True)
class Solution:
    """Solution of the bundle adjustment.

    Attributes
    ----------
    camera : CameraModel
        Camera.
    poses : tuple of Pose
        Pose of the board in each view.
    residuals_px : tuple of ndarray of float64
        Residuals of each view, seen less model [px], (corner, 2).
    covariance : ndarray of float64
        Covariance of PARAMETERS, (9, 9).
    rms_px : float
        Rms residual [px].
    degrees_of_freedom : int
        Degrees of freedom.
    """

    camera: CameraModel
    poses: tuple[Pose, ...]
    residuals_px: tuple[NDArray[np.float64], ...]
    covariance: NDArray[np.float64]
    rms_px: float
    degrees_of_freedom: int


def choose_free_parameters(*, fix_aspect_ratio: bool, radial_terms: int, tangential: bool) -> FreeParameters:
    """Return which of the nine parameters are free.

    Parameters
    ----------
    fix_aspect_ratio : bool
        True for square pixels, fx = fy.
    radial_terms : int
        Number of k1, k2, k3 that are free.
    tangential : bool
        True if p1 and p2 are free.
    """
    free = [np.eye(len(PARAMETERS))[PARAMETERS.index(name)] for name in ("fx_px", "fy_px")]
    columns = [free[0] + free[1]] if fix_aspect_ratio else free
    names = ["cx_px", "cy_px", *(f"k{term}" for term in range(1, radial_terms + 1))]
    names += ["p1", "p2"] if tangential else []
    columns += [np.eye(len(PARAMETERS))[PARAMETERS.index(name)] for name in names]
    return FreeParameters(np.column_stack(columns))


def solve(
    views: Sequence[View],
    free: FreeParameters,
    *,
    height_px: int,
    width_px: int,
    start: tuple[CameraModel, Sequence[NDArray[np.float64]]] | None = None,
    tolerance_rel: float = TOLERANCE_REL,
) -> Solution:
    """Find the camera and the poses by least squares over all corners.

    Parameters
    ----------
    views : sequence of View
        Corners of each picture.
    free : FreeParameters
        Free parameters of the camera.
    height_px, width_px : int
        Size of the picture [px].
    start : tuple of (CameraModel, sequence of ndarray), optional
        Camera and pose of each board, (6,), to start from.
    tolerance_rel : float
        Relative change at which the descent ends.

    Returns
    -------
    Solution
        Camera, poses and covariance.

    Raises
    ------
    InputRejected
        `fit_failed` if the views do not determine the camera.

    Notes
    -----
    S = sum |seen - model|^2 is minimised by Levenberg and Marquardt's steps with the poses eliminated
    (Schur's complement), from Zhang's closed form [1]_. With n corners and p parameters that are free in
    all::

        rms = sqrt(S / n),   covariance = S / (2 n - p) (J^T J)^-1

    Corners are taken as equally uncertain and independent; OpenCV's standard errors are the same.

    References
    ----------
    .. [1] Z. Zhang, A flexible new technique for camera calibration, IEEE TPAMI 22(11),
       2000
    """
    size = {"height_px": height_px, "width_px": width_px}

    def linearise(block: int, values: NDArray[np.float64], pose: NDArray[np.float64]) -> Linear:
        camera = CameraModel.from_parameters(free.directions @ values, **size)
        return linearise_view(camera, views[block], pose, free)

    try:
        camera, poses = start or _start(views, free, **size)
        values = free.directions.T @ camera.parameters / free.directions.sum(axis=0)
        found = minimise(linearise, values, np.array(poses), tolerance_rel=tolerance_rel)
        return _conclude(found, views, free, **size)
    except (cv2.error, np.linalg.LinAlgError, FloatingPointError) as error:
        raise InputRejected(shared.FIT_FAILED, _ADVICE) from error


def linearise_view(
    camera: CameraModel, view: View, pose: NDArray[np.float64], free: FreeParameters
) -> Linear:
    """Return residuals and derivatives of one view.

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    view : View
        Corners of the board in the picture.
    pose : ndarray of float64
        Rodrigues vector and shift of the board [mm], (6,).
    free : FreeParameters
        Free parameters of the camera.

    Returns
    -------
    Linear
        Residuals [px], col before row, and the derivatives by the camera's free parameters and by the pose.
    """
    seen, jacobian = cv2.projectPoints(view.points_mm, pose[:3], pose[3:], camera.matrix, camera.distortion)
    residual = view.seen_px[:, ::-1] - np.asarray(seen).reshape(-1, 2)
    slopes = np.asarray(jacobian, np.float64)
    return Linear(residual.ravel(), slopes[:, _POSE:] @ free.directions, slopes[:, :_POSE])


def require_determined(solution: Solution) -> None:
    """Check that the principal distance of a camera is known to 10 %.

    Raises
    ------
    InputRejected
        `fit_failed` if it is not.
    """
    if solution.covariance[0, 0] > (_WORST_FOCAL_REL * solution.camera.fx_px) ** 2:
        raise InputRejected(shared.FIT_FAILED, _ADVICE)


def find_pose(camera: CameraModel, view: View) -> Pose:
    """Find where a board is that a known camera sees.

    Parameters
    ----------
    camera : CameraModel
        Camera model.
    view : View
        Corners of the board in the picture.
    """
    _, rotation, shift = cv2.solvePnP(
        view.points_mm, np.ascontiguousarray(view.seen_px[:, ::-1]), camera.matrix, camera.distortion
    )
    return Pose(np.asarray(rotation, np.float64).ravel(), np.asarray(shift, np.float64).ravel())


def _start(
    views: Sequence[View], free: FreeParameters, *, height_px: int, width_px: int
) -> tuple[CameraModel, list[NDArray[np.float64]]]:
    points = [view.points_mm.astype(np.float32) for view in views]
    seen = [np.ascontiguousarray(view.seen_px[:, ::-1], np.float32) for view in views]
    square = free.directions[:2].any(axis=0).sum() == 1
    started = cv2.initCameraMatrix2D(points, seen, (width_px, height_px), 1.0 if square else 0.0)
    matrix = np.asarray(started, np.float64)
    if not np.isfinite(matrix).all():
        raise FloatingPointError("the start is not finite")
    camera = CameraModel(
        height_px=height_px,
        width_px=width_px,
        fx_px=float(matrix[0, 0]),
        fy_px=float(matrix[1, 1]),
        cx_px=float(matrix[0, 2]),
        cy_px=float(matrix[1, 2]),
    )
    return camera, [find_pose(camera, view).vector for view in views]


def _conclude(
    found: Minimum, views: Sequence[View], free: FreeParameters, *, height_px: int, width_px: int
) -> Solution:
    camera = CameraModel.from_parameters(
        free.directions @ found.shared, height_px=height_px, width_px=width_px
    )
    corners = sum(len(view.points_mm) for view in views)
    dof = 2 * corners - len(found.shared) - _POSE * len(views)
    total = np.sum([reduce(block)[0] for block in found.linear], axis=0)
    low, high = (factor * max(height_px, width_px) for factor in _PLAUSIBLE_FOCAL)
    # where views do not hold a camera it runs away along with the boards' distances
    plausible = all(low < focal < high for focal in (camera.fx_px, camera.fy_px))
    if not plausible or not np.all(np.diag(total) > 0.0):
        raise InputRejected(shared.FIT_FAILED, _ADVICE)
    scale = np.sqrt(np.diag(total))
    scaled = total / np.outer(scale, scale)
    if not np.linalg.cond(scaled) < _WORST_CONDITION:
        raise InputRejected(shared.FIT_FAILED, _ADVICE)
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    covariance = free.directions @ inverse @ free.directions.T * found.cost / dof
    return Solution(
        camera=camera,
        poses=tuple(Pose(pose[:3], pose[3:]) for pose in found.poses),
        residuals_px=tuple(block.residuals.reshape(-1, 2)[:, ::-1] for block in found.linear),
        covariance=(covariance + covariance.T) / 2.0,
        rms_px=float(np.sqrt(found.cost / corners)),
        degrees_of_freedom=dof,
    )
