"""Suggestions for a set of pictures: what it lacks for a good fit, beyond what any fit needs."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected
from radiometry.geometry import codes
from radiometry.geometry.coverage import CELLS, count_cells
from radiometry.geometry.findings import GOOD_SHARE, GOOD_VIEWS
from radiometry.geometry.fit import fit_geometry
from radiometry.geometry.rows import FrameRow, Params
from radiometry.geometry.views import Candidate, collect_candidates, make_view, missing
from radiometry.specification.grid import Gap

_ADVICE: Final[dict[str, str]] = {
    codes.TILT_POOR: "tilt the board by 20 to 45 degrees, to the left, to the right, up and down",
    codes.VIEW_OUTLIER: "take {where} again, or leave it out: {detail}",
    codes.CORNER_WINDOW_WIDE: "come closer, take larger squares, or fit with corner_window fitted: {detail}",
    codes.DISTORTION_FOLDS: "bring the board into the frame's corners: it is not determined there",
    codes.REPROJECTION_LARGE: "the board does not fit the model: is it flat, and are the pictures sharp?",
}
_ROWS: Final = ("top", "middle", "bottom")
_COLS: Final = ("left", "centre", "right")


def plan_views(rows: Sequence[FrameRow], params: Params) -> tuple[str, ...]:
    """List, by name, what to add while the board is still set up.

    Returns
    -------
    tuple of str
        Suggestions, as fragments, the most serious first.
    """
    usable = [each for each in collect_candidates(rows, params) if not each.left_out]
    found = []
    if 0 < len(usable) < GOOD_VIEWS:
        found.append(f"{len(usable)} usable views: add {GOOD_VIEWS - len(usable)} more")
    return (*found, *_plan_coverage(usable, params), *_plan_by_flags(rows, params))


def find_gaps(rows: Sequence[FrameRow], params: Params) -> tuple[Gap, ...]:
    """List the views of the board that are lacking."""
    usable = sum(not each.left_out for each in collect_candidates(rows, params))
    return tuple(Gap(role="chart", text="View of the board") for _ in range(GOOD_VIEWS - usable))


def _plan_coverage(usable: Sequence[Candidate], params: Params) -> list[str]:
    """Name the ninths of the frame in which most cells hold no corner."""
    features = [each.features for each in usable if each.features]
    if not features:
        return []
    counts = count_cells(
        [make_view(each, params).seen_px for each in features],
        height_px=features[0].height_px,
        width_px=features[0].width_px,
    )
    if np.count_nonzero(counts) >= GOOD_SHARE * counts.size:
        return []
    empty = [
        f"{row_name} {col_name}"
        for row_name, rows in zip(_ROWS, _ninths(), strict=True)
        for col_name, cols in zip(_COLS, _ninths(), strict=True)
        if np.count_nonzero(counts[np.ix_(rows, cols)]) * 2 < len(rows) * len(cols)
    ]
    where = f": {', '.join(empty)}" if empty else ""
    return [f"bring the board into the parts of the frame that hold few corners{where}"]


def _ninths() -> list[NDArray[np.int64]]:
    return np.array_split(np.arange(CELLS), 3)


def _plan_by_flags(rows: Sequence[FrameRow], params: Params) -> list[str]:
    if missing(rows, params):
        return []
    try:
        fit = fit_geometry(rows, params)
    except InputRejected:
        return [_ADVICE[codes.TILT_POOR]]
    return [
        _ADVICE[raised.flag].format(where=raised.where, detail=raised.detail.rstrip("."))
        for raised in fit.flags
        if raised.flag in _ADVICE
    ]
