"""The camera model, and the bundle adjustment: camera and poses of the boards that fit the corners best.

Its own least squares, since OpenCV's takes corners in single precision and states no covariance; it also
gives other last digits with other numbers of threads. On OpenCV's own set the two agree to eleven digits,
standard errors to eight.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import shared
from radiometry.frame import Frame
from radiometry.frame.opencv import cv2
from radiometry.records import Record

# In OpenCV's order, which is that of covariances too
PARAMETERS: Final = ("fx_px", "fy_px", "cx_px", "cy_px", "k1", "k2", "p1", "p2", "k3")
UNITS: Final = {name: "px" if name.endswith("_px") else "1" for name in PARAMETERS}
MODEL: Final = "brown_conrady"


class CameraModel(Record):
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
        """Return the camera of parameters in the order of PARAMETERS."""
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
    """Compute where points of a board [mm] appear: (point, 2) [px], row before col."""
    seen, _ = cv2.projectPoints(points_mm, rotation, shift, camera.matrix, camera.distortion)
    return np.asarray(seen, np.float64).reshape(-1, 2)[:, ::-1]


def find_directions(camera: CameraModel, places_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the directions (x, y), at unit distance, that places (row, col) in the picture see."""
    seen = np.ascontiguousarray(places_px[:, ::-1]).reshape(-1, 1, 2)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    ideal = cv2.undistortPoints(seen, camera.matrix, camera.distortion, criteria=stop)
    return np.asarray(ideal, np.float64).reshape(-1, 2)


BINOMIAL: Final = np.array([0.25, 0.5, 0.25])
_DARK_PERCENTILE, _BRIGHT_PERCENTILE = 0.5, 99.5
_PERCENTILE_SAMPLES: Final = 1 << 20


class Grey(Record, kw_only=False):
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


class Undistorted(Record):
    """Undistorted picture of a frame in raw numbers, black not subtracted."""

    # Samples [DN], (row, col) or (row, col, plane), 0 where the camera did not see
    samples_dn: NDArray[np.uint16]
    planes: tuple[str, ...]  # ("grey",) or ("R", "G", "B")
    seen_share: float  # Fraction of the pixels that the camera saw


def undistort_frame(frame: Frame, camera: CameraModel) -> Undistorted:
    """Compute the undistorted picture of a whole frame.

    A rendered colour picture keeps its planes. A mosaic becomes one grey plane, in which the four sites of
    its pattern weigh a quarter each around every pixel: the picture in which the calibration places corners.
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
    if (height_px, width_px) != (camera.height_px, camera.width_px):
        raise shared.WRONG_CAMERA.reject(
            f"The picture is {width_px} x {height_px} pixels, the calibration holds for "
            f"{camera.width_px} x {camera.height_px}. Take a picture of the same size and crop."
        )


def undistort(samples: NDArray[_Sample], camera: CameraModel) -> tuple[NDArray[_Sample], NDArray[np.bool_]]:
    """Compute the undistorted picture; size, scale and principal point stay the camera's.

    result(row, col) = samples where the model shows the direction ((col - cx)/fx, (row - cy)/fy), by bilinear
    interpolation. What lies outside of the picture is 0 (NaN in float32) and False in the second result: a
    pixel counts as inside when its four neighbours are. Nothing is cropped and nothing is made up.
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


class Minimum(Record, kw_only=False):
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


class View(Record, kw_only=False):
    """Corners of one picture."""

    points_mm: NDArray[np.float64]  # Corners on the board [mm], (corner, 3)
    seen_px: NDArray[np.float64]  # Corners in the picture [px], (corner, 2), row before col


class Pose(Record, kw_only=False):
    """Where a board is: Rodrigues vector and shift [mm], from the board's frame into the camera's."""

    rotation: NDArray[np.float64]
    shift: NDArray[np.float64]

    @property
    def vector(self) -> NDArray[np.float64]:
        """Rodrigues vector and shift, (6,)."""
        return np.concatenate((self.rotation, self.shift))


class FreeParameters(Record, kw_only=False):
    """Free parameters of the camera: its nine are `directions` times the free ones, or zero."""

    # Directions, (9, free); with square pixels fx and fy are one free parameter
    directions: NDArray[np.float64]


class Solution(Record, kw_only=False):
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
    (Schur's complement), from Zhang's closed form [1]. With n corners and p parameters that are free in all::

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
        raise shared.FIT_FAILED.reject(_ADVICE) from error


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
        raise shared.FIT_FAILED.reject(_ADVICE)


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
        raise shared.FIT_FAILED.reject(_ADVICE)
    scale = np.sqrt(np.diag(total))
    scaled = total / np.outer(scale, scale)
    if not np.linalg.cond(scaled) < _WORST_CONDITION:
        raise shared.FIT_FAILED.reject(_ADVICE)
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
