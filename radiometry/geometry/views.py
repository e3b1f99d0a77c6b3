"""Views of the fit: which pictures are used, which are left out and why, and what is missing."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.drawing.text import name_few
from radiometry.findings import Finding
from radiometry.fitting.evidence import list_unknown_exclusions
from radiometry.geometry import codes
from radiometry.geometry.bundle import FreeParameters, Solution, View, solve
from radiometry.geometry.features import Features
from radiometry.geometry.mirror import TURNS, Hidden, find_turned, measure_hidden
from radiometry.geometry.rows import CHART, FrameRow, Params
from radiometry.geometry.target import locate_corners_mm

FEWEST_VIEWS: Final = 3
"""Zhang's method needs three for a camera of five unknowns; a good one needs ten."""


@dataclass(frozen=True)
class Candidate:
    """Picture of a board; `left_out` is "" when it counts."""

    row: FrameRow
    features: Features | None
    left_out: str


@dataclass(frozen=True)
class Rejected:
    """Picture that the fit rejected, with the reason, and the finding where it deserves a flag."""

    candidate: Candidate
    why: str
    finding: Finding | None = None


@dataclass(frozen=True)
class FittedViews:
    """Views that were used, with their solution, and those that were rejected.

    ``hidden`` : what a rendered picture that is turned, and is not found, would do
    """

    used: tuple[Candidate, ...]
    solution: Solution
    rejected: tuple[Rejected, ...]
    hidden: Hidden | None


def missing(rows: Sequence[FrameRow], params: Params, *, unread: Sequence[str] = ()) -> tuple[str, ...]:
    """List, by name, what keeps a fit from starting."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    found = list_unknown_exclusions(params.exclude, [*(row.frame for row in rows), *unread])
    unread = [name for name in unread if name not in excluded]
    if unread:
        found.append(f"not read yet: {name_few('frame', unread)}")
    charts = [row for row in rows if row.role == CHART and row.frame not in excluded]
    unsearched = [row.frame for row in charts if row.features is None]
    if unsearched:
        found.append(f"not searched for the board yet: {name_few('frame', unsearched)}")
    waiting = len(unread) + len(unsearched)
    usable = sum(not candidate.left_out for candidate in collect_candidates(rows, params))
    if usable + waiting < FEWEST_VIEWS:
        found.append(f"{FEWEST_VIEWS} views of the board are needed at least, {usable} can be used")
    return tuple(found)


def collect_candidates(rows: Sequence[FrameRow], params: Params) -> tuple[Candidate, ...]:
    """Return the pictures of a board in the order of their names, whatever the order of the input.

    Parameters
    ----------
    rows : sequence of FrameRow
        Evidence of the campaign's frames.
    params : Params
        Parameters of the fit.
    """
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


def make_view(features: Features, params: Params) -> View:
    """Return a picture's corners in the form that the solver needs.

    Returns
    -------
    View
        Corners on the board and in the picture.
    """
    seen = features.fixed_px if params.corner_window == "fixed" else features.fitted_px
    return View(locate_corners_mm(features.target, np.array(features.indices)), np.array(seen))


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

    Parameters
    ----------
    candidates : sequence of Candidate
        Pictures of a board.
    params : Params
        Parameters of the fit.
    free : FreeParameters
        Free parameters of the camera.

    Returns
    -------
    FittedViews
        Views that were used, and their solution.

    Notes
    -----
    The clearest goes first, then all others are fitted again. A rejected view never costs the fit: with
    three views left no more are rejected.
    """
    kept, rejected, turns = _compare_colours([each for each in candidates if not each.left_out])
    limit = params.reject_above_px
    while True:
        views = [make_view(each.features, params) for each in kept if each.features]
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
            return FittedViews(tuple(kept), solution, tuple(rejected), hidden)


def measure_rms_px(residual_px: NDArray[np.float64]) -> float:
    """Compute the root mean square distance of a view's corners from the model.

    Parameters
    ----------
    residual_px : ndarray of float64
        Residuals [px], (corner, 2).

    Returns
    -------
    float
        Rms [px].
    """
    return math.sqrt(float((residual_px**2).sum()) / len(residual_px))
