"""Verdicts on pictures while the board is still set up, and what a set of them lacks."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import InputRejected, Raised, Reason
from radiometry.frame.verdicts import ReviewedFrame, Verdict, assume_whole_frame, conclude, inspect_frames
from radiometry.geometry import codes, results, views
from radiometry.geometry.fit import CELLS, GOOD_SHARE, GOOD_VIEWS, count_cells, fit_geometry
from radiometry.specification.roles import Gap

BLURRED_RISE_PX: Final = 5.0
SMALL_SHARE: Final = 0.05


def judge_frames(frames: Sequence[ReviewedFrame], rows: Sequence[results.FrameRow]) -> dict[str, Verdict]:
    reasons = inspect_frames([assume_whole_frame(frame) for frame in frames])
    for row in rows:
        if row.role == results.CHART and row.features is not None and row.frame in reasons:
            reasons[row.frame] += _inspect(row.features)
    return {frame: conclude(found) for frame, found in reasons.items()}


def check_features(features: results.Features) -> list[Raised]:
    """Return the flags of a picture that was searched for its board."""
    return [codes.BOARD_NOT_FOUND.at("", features.not_found)] if features.not_found else []


def _inspect(features: results.Features) -> list[Reason]:
    if features.not_found:
        detail = (
            f"The board cannot be used: {features.not_found}. Show all of a checkerboard with a white "
            "margin, sharp, flat and free of glare, and check the numbers of its corners in the campaign."
        )
        return [codes.BOARD_NOT_FOUND.reason(detail)]
    found = []
    if features.edge_rise_px is not None and features.edge_rise_px > BLURRED_RISE_PX:
        detail = (
            f"The edges of the squares rise over {features.edge_rise_px:.1f} px, {BLURRED_RISE_PX:g} px are "
            "tolerable. Focus, hold still, and take a shorter time."
        )
        found.append(codes.BOARD_BLURRED.reason(detail))
    if features.board_share < SMALL_SHARE:
        detail = (
            f"The board spans {features.board_share:.1%} of the frame: come closer, so that it fills a tenth "
            "to a half."
        )
        found.append(codes.BOARD_SMALL.reason(detail))
    return found


_ADVICE: Final[dict[str, str]] = {
    codes.TILT_POOR: "tilt the board by 20 to 45 degrees, to the left, to the right, up and down",
    codes.VIEW_OUTLIER: "take {where} again, or leave it out: {detail}",
    codes.DISTORTION_FOLDS: "bring the board into the frame's corners: it is not determined there",
    codes.REPROJECTION_LARGE: "the board does not fit the model: is it flat, and are the pictures sharp?",
}
_ROWS: Final = ("top", "middle", "bottom")
_COLS: Final = ("left", "centre", "right")


def plan_views(rows: Sequence[results.FrameRow], params: results.Params) -> tuple[str, ...]:
    usable = [each for each in views.collect_candidates(rows, params) if not each.left_out]
    found = []
    if 0 < len(usable) < GOOD_VIEWS:
        found.append(f"{len(usable)} usable views: add {GOOD_VIEWS - len(usable)} more")
    return (*found, *_plan_coverage(usable), *_plan_by_flags(rows, params))


def find_gaps(rows: Sequence[results.FrameRow], params: results.Params) -> tuple[Gap, ...]:
    usable = sum(not each.left_out for each in views.collect_candidates(rows, params))
    return tuple(Gap(role="chart", text="View of the board") for _ in range(GOOD_VIEWS - usable))


def _plan_coverage(usable: Sequence[views.Candidate]) -> list[str]:
    """Name the ninths of the frame in which most cells hold no corner."""
    features = [each.features for each in usable if each.features]
    if not features:
        return []
    counts = count_cells(
        [views.make_view(each).seen_px for each in features],
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


def _plan_by_flags(rows: Sequence[results.FrameRow], params: results.Params) -> list[str]:
    if views.missing(rows, params):
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
