"""The camera and the boards' poses that fit the corners best: a bundle adjustment.

Its own least squares, since OpenCV's sums over threads: the same views give other last digits every time. On
OpenCV's own set the two agree to eleven digits, standard errors to eight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.geometry.camera import PARAMETERS, CameraModel

_MOST_STEPS: Final = 200
_SETTLED_REL: Final = 1e-12
_MOST_DAMPING: Final = 1e12
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


class _Block(NamedTuple):
    """One view's sums: c of the camera's free parameters, p of the pose's six, e of the residuals."""

    cc: NDArray[np.float64]
    cp: NDArray[np.float64]
    pp: NDArray[np.float64]
    ce: NDArray[np.float64]
    pe: NDArray[np.float64]


@dataclass(frozen=True)
class _Normal:
    """The normal equations of a state, view by view."""

    cost: float
    blocks: tuple[_Block, ...]
    residuals: tuple[NDArray[np.float64], ...]


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

    Returns
    -------
    FreeParameters
        Free parameters.
    """
    free = [np.eye(len(PARAMETERS))[PARAMETERS.index(name)] for name in ("fx_px", "fy_px")]
    columns = [free[0] + free[1]] if fix_aspect_ratio else free
    names = ["cx_px", "cy_px", *(f"k{term}" for term in range(1, radial_terms + 1))]
    names += ["p1", "p2"] if tangential else []
    columns += [np.eye(len(PARAMETERS))[PARAMETERS.index(name)] for name in names]
    return FreeParameters(np.column_stack(columns))


def solve(views: Sequence[View], free: FreeParameters, *, height_px: int, width_px: int) -> Solution:
    """Find the camera and the poses by least squares over all corners.

    Parameters
    ----------
    views : sequence of View
        Corners of each picture.
    free : FreeParameters
        Free parameters of the camera.
    height_px, width_px : int
        Size of the picture [px].

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
    try:
        camera, poses = _start(views, free, height_px=height_px, width_px=width_px)
        return _descend(views, free, camera, poses)
    except (cv2.error, np.linalg.LinAlgError, FloatingPointError) as error:
        raise InputRejected(shared.FIT_FAILED, _ADVICE) from error


def require_determined(solution: Solution) -> None:
    """Check that the principal distance of a camera is known to 10 %.

    Parameters
    ----------
    solution : Solution
        Solution of the fit.

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

    Returns
    -------
    Pose
        Pose of the board.
    """
    _, rotation, shift = cv2.solvePnP(
        view.points_mm, np.ascontiguousarray(view.seen_px[:, ::-1]), camera.matrix, camera.distortion
    )
    return Pose(np.asarray(rotation, np.float64).ravel(), np.asarray(shift, np.float64).ravel())


def _start(
    views: Sequence[View], free: FreeParameters, *, height_px: int, width_px: int
) -> tuple[CameraModel, list[Pose]]:
    points = [view.points_mm.astype(np.float32) for view in views]
    seen = [np.ascontiguousarray(view.seen_px[:, ::-1], np.float32) for view in views]
    square = free.directions[:2].any(axis=0).sum() == 1
    started = cv2.initCameraMatrix2D(points, seen, (width_px, height_px), 1.0 if square else 0.0)
    matrix = np.asarray(started, np.float64)
    _require_finite(matrix)
    camera = CameraModel(
        height_px=height_px,
        width_px=width_px,
        fx_px=float(matrix[0, 0]),
        fy_px=float(matrix[1, 1]),
        cx_px=float(matrix[0, 2]),
        cy_px=float(matrix[1, 2]),
    )
    return camera, [find_pose(camera, view) for view in views]


def _descend(views: Sequence[View], free: FreeParameters, camera: CameraModel, poses: list[Pose]) -> Solution:
    normal = _linearise(views, free, camera, poses)
    damping = 1e-3
    for _ in range(_MOST_STEPS):
        tried, moved, step = _try_step(normal, free, camera, poses, damping)
        then = _linearise(views, free, tried, moved)
        if np.isfinite(then.cost) and then.cost <= normal.cost:
            gain = normal.cost - then.cost
            camera, poses, normal = tried, moved, then
            damping = max(damping / 10.0, 1e-12)
            if gain <= _SETTLED_REL * normal.cost and step <= _SETTLED_REL:
                break
        elif damping >= _MOST_DAMPING or step <= _SETTLED_REL:
            break
        else:
            damping *= 10.0
    return _conclude(views, free, camera, poses, normal)


def _linearise(
    views: Sequence[View], free: FreeParameters, camera: CameraModel, poses: Sequence[Pose]
) -> _Normal:
    blocks, residuals, cost = [], [], 0.0
    for view, pose in zip(views, poses, strict=True):
        seen, jacobian = cv2.projectPoints(
            view.points_mm, pose.rotation, pose.shift, camera.matrix, camera.distortion
        )
        residual = view.seen_px[:, ::-1] - np.asarray(seen).reshape(-1, 2)
        of_pose = np.asarray(jacobian[:, :_POSE], np.float64)
        of_camera = np.asarray(jacobian[:, _POSE:], np.float64) @ free.directions
        error = residual.ravel()
        blocks.append(
            _Block(
                cc=of_camera.T @ of_camera,
                cp=of_camera.T @ of_pose,
                pp=of_pose.T @ of_pose,
                ce=of_camera.T @ error,
                pe=of_pose.T @ error,
            )
        )
        residuals.append(residual[:, ::-1])
        cost += float(error @ error)
    return _Normal(cost, tuple(blocks), tuple(residuals))


def _try_step(
    normal: _Normal, free: FreeParameters, camera: CameraModel, poses: Sequence[Pose], damping: float
) -> tuple[CameraModel, list[Pose], float]:
    """Return the next state, and the largest change of a parameter relative to itself."""
    count = free.directions.shape[1]
    total, right, ways = np.zeros((count, count)), np.zeros(count), []
    for cc, cp, pp, ce, pe in normal.blocks:
        way = np.linalg.solve(pp + np.diag(np.diag(pp)) * damping, np.column_stack((cp.T, pe)))
        total += cc - cp @ way[:, :-1]
        right += ce - cp @ way[:, -1]
        ways.append(way)
    total += np.diag(np.diag(total)) * damping
    step = np.linalg.solve(total, right)
    values = camera.parameters + free.directions @ step
    _require_finite(values)
    tried = CameraModel.from_parameters(values, height_px=camera.height_px, width_px=camera.width_px)
    moved = []
    for way, pose in zip(ways, poses, strict=True):
        turn = way[:, -1] - way[:, :-1] @ step
        moved.append(Pose(pose.rotation + turn[:3], pose.shift + turn[3:]))
    change = np.abs(free.directions @ step) / np.maximum(np.abs(values), 1e-6)
    return tried, moved, float(change.max())


def _conclude(
    views: Sequence[View], free: FreeParameters, camera: CameraModel, poses: Sequence[Pose], normal: _Normal
) -> Solution:
    corners = sum(len(view.points_mm) for view in views)
    count = free.directions.shape[1]
    dof = 2 * corners - count - _POSE * len(views)
    total = np.zeros((count, count))
    for cc, cp, pp, _, _ in normal.blocks:
        total += cc - cp @ np.linalg.solve(pp, cp.T)
    _require_sense(camera, np.diag(total))
    scale = np.sqrt(np.diag(total))
    scaled = total / np.outer(scale, scale)
    if not np.linalg.cond(scaled) < _WORST_CONDITION:
        raise InputRejected(shared.FIT_FAILED, _ADVICE)
    inverse = np.linalg.inv(scaled) / np.outer(scale, scale)
    covariance = free.directions @ inverse @ free.directions.T * normal.cost / dof
    return Solution(
        camera=camera,
        poses=tuple(poses),
        residuals_px=normal.residuals,
        covariance=(covariance + covariance.T) / 2.0,
        rms_px=float(np.sqrt(normal.cost / corners)),
        degrees_of_freedom=dof,
    )


def _require_sense(camera: CameraModel, information: NDArray[np.float64]) -> None:
    """Refuse a camera that has run away: where views do not hold it, it does so along with its distances."""
    low, high = (factor * max(camera.height_px, camera.width_px) for factor in _PLAUSIBLE_FOCAL)
    plausible = all(low < focal < high for focal in (camera.fx_px, camera.fy_px))
    if not plausible or not np.all(information > 0.0):
        raise InputRejected(shared.FIT_FAILED, _ADVICE)


def _require_finite(values: NDArray[np.float64]) -> None:
    if not np.isfinite(values).all():
        raise InputRejected(shared.FIT_FAILED, _ADVICE)
