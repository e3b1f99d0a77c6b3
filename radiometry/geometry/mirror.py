"""Pictures that are mirrored or turned against the others, which moves the principal point."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.geometry.bundle import (
    FreeParameters,
    Pose,
    Solution,
    View,
    choose_free_parameters,
    find_pose,
    linearise_view,
    solve,
)
from radiometry.geometry.camera import PARAMETERS, CameraModel
from radiometry.geometry.descent import reduce

TURNS: Final = {
    "mirrored left to right": (False, True),
    "mirrored upside down": (True, False),
    "turned by 180 degrees": (True, True),
}
"""Whether rows, and columns, run the other way."""

# of 2 ln of the likelihood ratio: the largest of good views, 0 to 13 px off the middle, in 320 sets was 12;
# at 16 a good view of a bent board looked turned in 7 of 160
_CLEAR: Final = 25.0
# a model that does not hold makes several views look turned, and none so much more than the others
_ALONE: Final = 2.0
# a turned view that is the right way round fits like the others
_USUAL_RATIO: Final = 1.5
_MOST_TRIED: Final = 4
_TOLERANCE_REL: Final = 1e-6
# of the scaled information of one view on the camera: a direction that it does not show
_KNOWN_REL: Final = 1e-8
_FREE: Final = choose_free_parameters(fix_aspect_ratio=False, radial_terms=3, tangential=True)


def find_turned(views: Sequence[View], solution: Solution, turns: Sequence[str]) -> tuple[int, str] | None:
    """Find the view that is most clearly mirrored or turned against the others.

    Parameters
    ----------
    views : sequence of View
        Corners of each picture, more than three.
    solution : Solution
        Solution of all views as they are.
    turns : sequence of str
        Words of TURNS to try.

    Returns
    -------
    tuple of (int, str) or None
        Number of the view and a word of TURNS; None if no view is clearly turned.

    Notes
    -----
    A plane board has no reverse side: seen in a mirror it is the same board in another pose, and only
    principal point and decentring tell. So the views that would gain most, in one step of the fit of all
    views with all parameters free, are tried the other way round. With v degrees of freedom and S the
    sum of squared residuals, a view is turned where

        v ln(S / S_turned) / phi > 25

    where that is twice what any other view gives, and where the view then fits like the others. phi is the
    Birge ratio of the cameras that single views would want, 1 where corners alone scatter: bent boards make
    views disagree and some look turned.
    """
    size = {"height_px": solution.camera.height_px, "width_px": solution.camera.width_px}
    try:
        start = solution.camera, [pose.vector for pose in solution.poses]
        plain = solve(views, _FREE, **size, start=start, tolerance_rel=_TOLERANCE_REL)
    except InputRejected:
        return None
    blocks = [_reduce(plain.camera, view, pose) for view, pose in zip(views, plain.poses, strict=True)]
    information, right, total = (sum(part) for part in zip(*blocks, strict=True))
    tried = []
    for number, (view, block) in enumerate(zip(views, blocks, strict=True)):
        for words in turns:
            turned = turn(view, words, **size)
            pose = find_pose(plain.camera, turned)
            own = _reduce(plain.camera, turned, pose)
            slope = right - block[1] + own[1]
            gain = slope @ np.linalg.solve(information - block[0] + own[0], slope)
            tried.append((float(own[2] - block[2] - gain), number, words, turned, pose.vector))
    tried.sort(key=lambda each: each[:2])
    best: dict[int, tuple[float, str]] = {}
    for _, number, words, turned, vector in tried[:_MOST_TRIED]:
        poses = [vector if place == number else pose.vector for place, pose in enumerate(plain.poses)]
        changed = [turned if place == number else view for place, view in enumerate(views)]
        try:
            other = solve(changed, _FREE, **size, start=(plain.camera, poses), tolerance_rel=_TOLERANCE_REL)
        except InputRejected:
            continue
        squares = [float((residual**2).mean()) for residual in other.residuals_px]
        gain = plain.degrees_of_freedom * math.log(total / _sum_squares(other))
        clear = gain / _measure_discord(changed, other) if gain > 0.0 else 0.0
        usual = squares[number] <= _USUAL_RATIO**2 * float(np.median(squares))
        if usual and clear > best.get(number, (0.0, ""))[0]:
            best[number] = clear, words
    first, second, *_ = *sorted(best, key=lambda number: -best[number][0]), -1, -1
    rival = best[second][0] if second in best else 0.0
    if first < 0 or best[first][0] <= max(_CLEAR, _ALONE * rival):
        return None
    return first, best[first][1]


def _reduce(
    camera: CameraModel, view: View, pose: Pose
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return a view's information on the camera, its right-hand side and its sum of squares."""
    block = linearise_view(camera, view, pose.vector, _FREE)
    return *reduce(block)[:2], float(block.residuals @ block.residuals)


def _sum_squares(solution: Solution) -> float:
    return sum(float((residual**2).sum()) for residual in solution.residuals_px)


def _measure_discord(views: Sequence[View], solution: Solution) -> float:
    """Return the squared Birge ratio of the camera's parameters between views, 1 at least."""
    gained, count = 0.0, -_FREE.directions.shape[1]
    for view, pose in zip(views, solution.poses, strict=True):
        information, right, _ = reduce(linearise_view(solution.camera, view, pose.vector, _FREE))
        scale = np.sqrt(np.diag(information))
        values, axes = np.linalg.eigh(information / np.outer(scale, scale))
        known = values > _KNOWN_REL * values[-1]
        gained += float((((axes.T @ (right / scale)) ** 2)[known] / values[known]).sum())
        count += int(known.sum())
    within = (_sum_squares(solution) - gained) / (solution.degrees_of_freedom - count)
    return float(max(1.0, gained / count / within))


def turn(view: View, words: str, *, height_px: int, width_px: int) -> View:
    """Return a view as the mirrored or turned picture shows it.

    Parameters
    ----------
    view : View
        Corners of the board in the picture.
    words : str
        A word of TURNS.
    height_px, width_px : int
        Size of the picture [px].

    Returns
    -------
    View
        Corners of the board in the other picture.
    """
    last = np.array([height_px - 1.0, width_px - 1.0])
    return replace(view, seen_px=np.where(TURNS[words], last - view.seen_px, view.seen_px))


@dataclass(frozen=True)
class Hidden:
    """Displacement that a turned picture would cause that is not found.

    ``number`` : of the view; ``words`` : of TURNS; ``shift_px`` : of the principal point, row and col
    ``ratio`` : of the larger shift to the standard uncertainty
    """

    number: int
    words: str
    shift_px: tuple[float, float]
    ratio: float


def measure_hidden(
    views: Sequence[View],
    solution: Solution,
    free: FreeParameters,
    *,
    numbers: Sequence[int],
    turns: Sequence[str],
) -> Hidden | None:
    """Estimate how far a turned view that the points do not show would displace the principal point.

    Parameters
    ----------
    views : sequence of View
        Views that were used.
    solution : Solution
        Their solution.
    free : FreeParameters
        Free parameters of the solution.
    numbers : sequence of int
        Numbers of the views that may be turned.
    turns : sequence of str
        Words of TURNS that the board does not exclude.

    Returns
    -------
    Hidden or None
        View and turn of the largest displacement in units of its standard uncertainty; None if all would be
        found.

    Notes
    -----
    A turned view wants the camera M x about the middle of the frame, where the others want x. With the
    information A_v of the view, its pose eliminated, and A of all::

        found = x + D (M - 1) x,   D = A^-1 A_v,   so that   x = (1 + D (M - 1))^-1 found

    The likelihood ratio of the turn is then expected at ((M - 1) x)' (A_v - A_v A^-1 A_v) (M - 1) x / s^2; it
    is taken as found from twice the limit of `find_turned`.
    """
    camera, names = solution.camera, [PARAMETERS[place] for place in free.directions.argmax(axis=0)]
    scale2 = _sum_squares(solution) / solution.degrees_of_freedom
    information = [
        reduce(linearise_view(camera, view, pose.vector, free))[0]
        for view, pose in zip(views, solution.poses, strict=True)
    ]
    total = np.linalg.inv(np.sum(information, axis=0))
    middle = dict(zip(("cy_px", "cx_px"), camera.centre_px, strict=True))
    found = np.array([getattr(camera, name) - middle.get(name, 0.0) for name in names])
    places = [names.index("cy_px"), names.index("cx_px")]
    errors = np.sqrt(np.diag(total)[places] * scale2)
    worst = None
    for number in numbers:
        for words in turns:
            upside, sideways = TURNS[words]
            changed = {"cy_px": upside, "p1": upside, "cx_px": sideways, "p2": sideways}
            change = np.array([-2.0 * changed.get(name, False) for name in names])  # M - 1
            own = information[number]
            truth = np.linalg.solve(np.eye(len(names)) + total @ own * change, found)
            wanted = change * truth
            if wanted @ (own - own @ total @ own) @ wanted / scale2 > 2.0 * _CLEAR:
                continue
            shift = (found - truth)[places]
            ratio = float((np.abs(shift) / errors).max())
            if worst is None or ratio > worst.ratio:
                worst = Hidden(number, words, (float(shift[0]), float(shift[1])), ratio)
    return worst
