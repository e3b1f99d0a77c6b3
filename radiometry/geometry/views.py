"""Views of a fit: which pictures are used, which are left out and why, and what turned boards would do."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from statistics import mode
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import Finding, InputRejected, grouping, shared
from radiometry.fitting.evidence import list_unknown_exclusions
from radiometry.geometry import codes, target
from radiometry.geometry.camera import (
    PARAMETERS,
    CameraModel,
    FreeParameters,
    Pose,
    Solution,
    View,
    choose_free_parameters,
    find_pose,
    linearise_view,
    reduce,
    solve,
)
from radiometry.geometry.results import CHART, Features, FrameRow, Params
from radiometry.records import Record

# Whether rows, and columns, run the other way
TURNS: Final = {
    "mirrored left to right": (False, True),
    "mirrored upside down": (True, False),
    "turned by 180 degrees": (True, True),
}

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
    gained, count = _compare_views(views, solution, _FREE)
    left = solution.degrees_of_freedom - count
    return max(1.0, gained / count / ((_sum_squares(solution) - gained) / left)) if left > 0 else 1.0


def widen(views: Sequence[View], solution: Solution, free: FreeParameters) -> tuple[Solution, float, int]:
    """Return a solution with the scatter of its views in its covariance, its Birge ratio, and its dof.

    Corners of one view share errors of detection, of light and of a board that is not flat. With A_v the
    information of a view and b_v its right-hand side, of q parameters::

        C = max(S / (2 n - p), sum(b_v' A_v^-1 b_v) / (sum(q_v) - q)) A^-1
    """
    gained, count = _compare_views(views, solution, free)
    squared = gained / count / (_sum_squares(solution) / solution.degrees_of_freedom)
    if squared <= 1.0:
        return solution, 1.0, solution.degrees_of_freedom
    return replace(solution, covariance=solution.covariance * squared), math.sqrt(squared), count


def _compare_views(views: Sequence[View], solution: Solution, free: FreeParameters) -> tuple[float, int]:
    """Return the fall of the sum of squares if each view has its own camera, and the parameters more."""
    gained, count = 0.0, -free.directions.shape[1]
    for view, pose in zip(views, solution.poses, strict=True):
        information, right, _ = reduce(linearise_view(solution.camera, view, pose.vector, free))
        scale = np.sqrt(np.diag(information))
        values, axes = np.linalg.eigh(information / np.outer(scale, scale))
        known = values > _KNOWN_REL * values[-1]
        gained += float((((axes.T @ (right / scale)) ** 2)[known] / values[known]).sum())
        count += int(known.sum())
    return gained, count


def turn(view: View, words: str, *, height_px: int, width_px: int) -> View:
    """Return a view as the mirrored or turned picture shows it."""
    last = np.array([height_px - 1.0, width_px - 1.0])
    return replace(view, seen_px=np.where(TURNS[words], last - view.seen_px, view.seen_px))


class Hidden(Record, kw_only=False):
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


FEWEST_VIEWS: Final = 3  # Zhang's method needs three for a camera of five unknowns; a good one needs ten


class Candidate(Record, kw_only=False):
    """Picture of a board; `left_out` is "" when it counts."""

    row: FrameRow
    features: Features | None
    left_out: str


class Rejected(Record, kw_only=False):
    """Picture that the fit rejected, with the reason, and the finding where it deserves a flag."""

    candidate: Candidate
    why: str
    finding: Finding | None = None


class FittedViews(Record, kw_only=False):
    """Views that were used, with their solution, and those that were rejected.

    ``solution`` : its covariance with the squared Birge ratio of the views; ``effective_dof`` : of that
    ``hidden`` : what a rendered picture that is turned, and is not found, would do
    """

    used: tuple[Candidate, ...]
    solution: Solution
    birge_ratio: float
    effective_dof: int
    rejected: tuple[Rejected, ...]
    hidden: Hidden | None


def missing(rows: Sequence[FrameRow], params: Params, *, unread: Sequence[str] = ()) -> tuple[str, ...]:
    excluded = {exclusion.frame for exclusion in params.exclude}
    found = list_unknown_exclusions(params.exclude, [*(row.frame for row in rows), *unread])
    unread = [name for name in unread if name not in excluded]
    if unread:
        found.append(grouping.name_frames("not read yet", unread, shared.NOT_READ))
    charts = [row for row in rows if row.role == CHART and row.frame not in excluded]
    unsearched = [row.frame for row in charts if row.features is None]
    if unsearched:
        found.append(grouping.name_frames("not searched for the board yet", unsearched, shared.NOT_EXTRACTED))
    waiting = len(unread) + len(unsearched)
    candidates = collect_candidates(rows, params)
    left_out = [each.left_out for each in candidates if each.left_out]
    usable = len(candidates) - len(left_out)
    if usable + waiting < FEWEST_VIEWS:
        why = f"; others: {mode(left_out)}" if left_out else ""
        found.append(f"{FEWEST_VIEWS} views of the board are needed at least, {usable} can be used{why}")
    return tuple(found)


def collect_candidates(rows: Sequence[FrameRow], params: Params) -> tuple[Candidate, ...]:
    """Return the pictures of a board in the order of their names, whatever the order of the input."""
    reasons = {exclusion.frame: f"{exclusion.reason} ({exclusion.by})" for exclusion in params.exclude}
    charts = sorted((row for row in rows if row.role == CHART), key=lambda row: row.frame)
    usual = _find_usual([row for row in charts if row.frame not in reasons])
    return tuple(
        Candidate(row, row.features, reasons.get(row.frame, "") or _inspect(row, usual)) for row in charts
    )


_Form = tuple[int, int, str]


def _form(features: Features) -> _Form:
    return features.height_px, features.width_px, repr(features.target)


def _find_usual(charts: Sequence[FrameRow]) -> _Form | None:
    """Return size and board of most pictures with a board; of equally many, the smallest by its numbers."""
    counts = Counter(_form(row.features) for row in charts if row.features and not row.features.not_found)
    return min(counts, key=lambda form: (-counts[form], form), default=None)


def _inspect(row: FrameRow, usual: _Form | None) -> str:
    features = row.features
    if features is None:
        return "not extracted"
    if features.not_found:
        return features.not_found
    if usual is not None and _form(features)[:2] != usual[:2]:
        return (
            f"it is {features.width_px} x {features.height_px} pixels, most are {usual[1]} x {usual[0]}: "
            "another crop or sensor mode"
        )
    return "it was searched for another board than most" if _form(features) != usual else ""


def make_view(features: Features) -> View:
    """Return a picture's corners in the form that the solver needs."""
    places = target.locate_corners_mm(features.target, np.array(features.indices))
    return View(points_mm=places, seen_px=np.array(features.fitted_px))


def _compare_colours(kept: list[Candidate]) -> tuple[list[Candidate], list[Rejected], tuple[str, ...]]:
    """Reject the few views whose squares have the colours of the board's mirror image.

    Returns what is kept, what is rejected, and the words of TURNS that the board does not exclude: markers
    cannot be read in a mirror, and colours show it on a board that differs from its mirror image.
    """
    hands = [_find_hand(each.features) for each in kept if each.features]
    few = min((1, -1), key=hands.count)
    mirrored = [each for each, hand in zip(kept, hands, strict=True) if hand == few]
    others = [each for each in kept if each not in mirrored]
    if 0 in hands or 2 * len(mirrored) == len(kept) or len(others) < FEWEST_VIEWS:
        board = kept[0].features
        read = board is not None and board.target.kind == "charuco"
        return kept, [], tuple(TURNS)[2:] if read else tuple(TURNS)
    why = "it is mirrored against the other pictures: its squares have the colours of the mirror image"
    return others, [Rejected(each, why, codes.VIEW_MIRRORED) for each in mirrored], tuple(TURNS)[2:]


def _find_hand(features: Features) -> int:
    """Return 1 or -1 by the way in which corners are numbered and the first square's colour, 0 if unknown."""
    if features.first_square is None:
        return 0
    seen = np.array(features.fitted_px).reshape(features.target.rows, features.target.columns, 2)
    (down, right), (lower, along) = seen[0, -1] - seen[0, 0], seen[-1, 0] - seen[0, 0]
    turn = right * lower - down * along
    return int(np.sign(turn)) * (1 if features.first_square == "white" else -1)


def fit_views(candidates: Sequence[Candidate], params: Params, free: FreeParameters) -> FittedViews:
    """Fit, and leave out views that are turned or fit worse than the limit, one by one.

    The clearest goes first, then all others are fitted again. A rejected view never costs the fit: with
    three views left no more are rejected.
    """
    kept, rejected, turns = _compare_colours([each for each in candidates if not each.left_out])
    limit = params.reject_above_px
    while True:
        views = [make_view(each.features) for each in kept if each.features]
        first = kept[0].features
        assert first is not None  # noqa: S101  a candidate that counts has features
        solution = solve(views, free, height_px=first.height_px, width_px=first.width_px)
        errors = [measure_rms_px(residual) for residual in solution.residuals_px]
        worst = int(np.argmax(errors))
        few = len(kept) <= FEWEST_VIEWS
        if not few and (turned := find_turned(views, solution, turns)):
            number, words = turned
            why = f"it is {words} against the other pictures"
            rejected.append(Rejected(kept.pop(number), why, codes.VIEW_MIRRORED))
        elif not few and limit is not None and errors[worst] > limit:
            why = f"it fits to {errors[worst]:.2f} px, worse than the limit of {limit:g} px"
            rejected.append(Rejected(kept.pop(worst), why))
        else:
            # a viewer turns rendered pictures and no raw file
            numbers = [number for number, each in enumerate(kept) if each.row.header.rendered]
            hidden = measure_hidden(views, solution, free, numbers=numbers, turns=turns)
            return FittedViews(tuple(kept), *widen(views, solution, free), tuple(rejected), hidden)


def measure_rms_px(residual_px: NDArray[np.float64]) -> float:
    return math.sqrt(float((residual_px**2).sum()) / len(residual_px))
