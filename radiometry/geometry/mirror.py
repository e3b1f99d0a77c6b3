"""Pictures that are mirrored or turned against the others, which moves the principal point."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from radiometry.findings import InputRejected
from radiometry.geometry.camera import project
from radiometry.geometry.descent import reduce
from radiometry.geometry.solving import (
    Solution,
    View,
    choose_free_parameters,
    find_pose,
    linearise_view,
    solve,
)

TURNS: Final = {
    "mirrored left to right": (False, True),
    "mirrored upside down": (True, False),
    "turned by 180 degrees": (True, True),
}
"""Whether rows, and columns, run the other way."""

# of 2 ln of the likelihood ratio: where the principal point is in the middle, its largest of 864 was 11
_CLEAR: Final = 25.0
# a model that does not hold makes several views look turned, and none so much more than the others
_ALONE: Final = 2.0
# a turned view that is the right way round fits like the others
_USUAL_RATIO: Final = 1.5
_MOST_TRIED: Final = 4
_SETTLED_REL: Final = 1e-6
# of the scaled information of one view on the camera: a direction that it does not show
_KNOWN_REL: Final = 1e-8
_FREE: Final = choose_free_parameters(fix_aspect_ratio=False, radial_terms=3, tangential=True)


def find_turned(views: Sequence[View], solution: Solution) -> tuple[int, str] | None:
    """Find the view that is most clearly mirrored or turned against the others.

    Parameters
    ----------
    views : sequence of View
        Corners of each picture, more than three.
    solution : Solution
        Solution of all views as they are.

    Returns
    -------
    tuple of (int, str) or None
        Number of the view and a word of TURNS; None if no view is clearly turned.

    Notes
    -----
    A plane board has no reverse side: seen in a mirror it is the same board in another pose, and only
    principal point and decentring tell. So the views that most look like it are tried the other way round,
    in a fit of all views with all parameters free. With v degrees of freedom and S the sum of squared
    residuals, a view is turned where

        v ln(S / S_turned) / phi > 25

    where that is twice what any other view gives, and where the view then fits like the others. phi is the
    Birge ratio of the cameras that single views would want, 1 where corners alone scatter: bent boards make
    views disagree and some look turned.
    """
    size = {"height_px": solution.camera.height_px, "width_px": solution.camera.width_px}
    try:
        start = solution.camera, [pose.vector for pose in solution.poses]
        plain = solve(views, _FREE, **size, start=start, settled_rel=_SETTLED_REL)
    except InputRejected:
        return None
    tried = []
    for number, (view, residual) in enumerate(zip(views, plain.residuals_px, strict=True)):
        for words in TURNS:
            turned = turn(view, words, **size)
            pose = find_pose(plain.camera, turned)
            left = turned.seen_px - project(plain.camera, view.points_mm, pose.rotation, pose.shift)
            tried.append((float((left**2).sum() - (residual**2).sum()), number, words, turned, pose.vector))
    tried.sort(key=lambda each: each[:2])
    total = _sum_squares(plain)
    best: dict[int, tuple[float, str]] = {}
    for _, number, words, turned, vector in tried[:_MOST_TRIED]:
        poses = [vector if place == number else pose.vector for place, pose in enumerate(plain.poses)]
        changed = [turned if place == number else view for place, view in enumerate(views)]
        try:
            other = solve(changed, _FREE, **size, start=(plain.camera, poses), settled_rel=_SETTLED_REL)
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
