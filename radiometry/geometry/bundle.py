"""The camera and the boards' poses that fit the corners best: a bundle adjustment.

Its own least squares, since OpenCV's takes corners in single precision and states no covariance; it also
gives other last digits with other numbers of threads. On OpenCV's own set the two agree to eleven digits,
standard errors to eight.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, shared
from radiometry.frame.opencv import cv2
from radiometry.geometry.camera import PARAMETERS, CameraModel

__all__ = ["Pose"]

Matrix = NDArray[np.float64]

_MOST_STEPS: Final = 200
TOLERANCE_REL: Final = 1e-12
_CONVERGED_STEPS: Final = 6
_ROUNDING_REL: Final = 1e-13
_MOST_DAMPING: Final = 1e12


class Linear(NamedTuple):
    """One block at a state: residuals, and derivatives of the model by shared parameters and by its pose."""

    residuals: Matrix
    of_shared: Matrix
    of_pose: Matrix


Linearise = Callable[[int, Matrix, Matrix], Linear]  # `(block, shared, pose) -> Linear`


@dataclass(frozen=True)
class Minimum:
    """State with the least sum of squares."""

    shared: Matrix  # Shared parameters, and the pose of each block, (block, 6)
    poses: Matrix
    linear: tuple[Linear, ...]  # Each block at this state
    cost: float  # Sum of the squared residuals


def minimise(
    linearise: Linearise, shared: Matrix, poses: Matrix, *, tolerance_rel: float = TOLERANCE_REL
) -> Minimum:
    """Minimise the sum of squared residuals by Levenberg's and Marquardt's steps from a start."""
    best = _evaluate(linearise, shared, poses)
    damping, converged = 1e-3, 0
    for _ in range(_MOST_STEPS):
        step, turns = _find_step(best.linear, damping)
        tried = best.shared + step
        if not np.isfinite(tried).all():
            raise FloatingPointError("the step is not finite")
        change = float((np.abs(step) / np.maximum(np.abs(tried), 1e-6)).max())
        then = _evaluate(linearise, tried, best.poses + turns)
        # the cost has rounding: steps that lower it by less still improve the parameters
        if np.isfinite(then.cost) and then.cost <= (1.0 + _ROUNDING_REL) * best.cost:
            gain, best = best.cost - then.cost, then
            damping = max(damping / 10.0, 1e-12)
            converged = converged + 1 if gain <= tolerance_rel * best.cost else 0
            if converged and (change <= tolerance_rel or converged == _CONVERGED_STEPS):
                break
        elif damping >= _MOST_DAMPING or change <= tolerance_rel:
            break
        else:
            damping *= 10.0
    return best


def reduce(block: Linear, *, damping: float = 0.0) -> tuple[Matrix, Matrix, Matrix]:
    """Eliminate the pose of a block from its normal equations (Schur's complement)."""
    residuals, of_shared, of_pose = block
    cross, own = of_shared.T @ of_pose, of_pose.T @ of_pose
    right = np.column_stack((cross.T, of_pose.T @ residuals))
    way = np.asarray(np.linalg.solve(own + np.diag(np.diag(own)) * damping, right), np.float64)
    return of_shared.T @ of_shared - cross @ way[:, :-1], of_shared.T @ residuals - cross @ way[:, -1], way


def _evaluate(linearise: Linearise, shared: Matrix, poses: Matrix) -> Minimum:
    linear = tuple(linearise(block, shared, pose) for block, pose in enumerate(poses))
    return Minimum(shared, poses, linear, sum(float(each.residuals @ each.residuals) for each in linear))


def _find_step(linear: tuple[Linear, ...], damping: float) -> tuple[Matrix, Matrix]:
    reduced = [reduce(block, damping=damping) for block in linear]
    total = np.sum([each[0] for each in reduced], axis=0)
    right = np.sum([each[1] for each in reduced], axis=0)
    step = np.linalg.solve(total + np.diag(np.diag(total)) * damping, right)
    return step, np.array([way[:, -1] - way[:, :-1] @ step for _, _, way in reduced])


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
    """Corners of one picture."""

    points_mm: NDArray[np.float64]  # Corners on the board [mm], (corner, 3)
    seen_px: NDArray[np.float64]  # Corners in the picture [px], (corner, 2), row before col


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
    """Free parameters of the camera: its nine are `directions` times the free ones, or zero."""

    # Directions, (9, free); with square pixels fx and fy are one free parameter
    directions: NDArray[np.float64]


@dataclass(frozen=True)
class Solution:
    """Solution of the bundle adjustment."""

    camera: CameraModel
    poses: tuple[Pose, ...]  # Pose of the board in each view
    residuals_px: tuple[NDArray[np.float64], ...]  # Residuals of each view, seen less model [px], (corner, 2)
    covariance: NDArray[np.float64]  # Covariance of PARAMETERS, (9, 9)
    rms_px: float  # Rms residual [px]
    degrees_of_freedom: int


def choose_free_parameters(*, fix_aspect_ratio: bool, radial_terms: int, tangential: bool) -> FreeParameters:
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

    S = sum |seen - model|^2 is minimised by Levenberg and Marquardt's steps with the poses eliminated
    (Schur's complement), from Zhang's closed form [1]. With n corners and p parameters that are free in
    all::

        rms = sqrt(S / n),   covariance = S / (2 n - p) (J^T J)^-1

    Corners are taken as equally uncertain and independent; OpenCV's standard errors are the same.

    [1] Z. Zhang, A flexible new technique for camera calibration, IEEE TPAMI 22(11), 2000
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
    """Return residuals and derivatives of one view."""
    seen, jacobian = cv2.projectPoints(view.points_mm, pose[:3], pose[3:], camera.matrix, camera.distortion)
    residual = view.seen_px[:, ::-1] - np.asarray(seen).reshape(-1, 2)
    slopes = np.asarray(jacobian, np.float64)
    return Linear(residual.ravel(), slopes[:, _POSE:] @ free.directions, slopes[:, :_POSE])


def require_determined(solution: Solution) -> None:
    """Check that the principal distance of a camera is known to 10 %."""
    if solution.covariance[0, 0] > (_WORST_FOCAL_REL * solution.camera.fx_px) ** 2:
        raise InputRejected(shared.FIT_FAILED, _ADVICE)


def find_pose(camera: CameraModel, view: View) -> Pose:
    """Find where a board is that a known camera sees."""
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
