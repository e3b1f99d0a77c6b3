"""Verdict on every picture of a board while it is still set up."""

from collections.abc import Sequence
from typing import Final

from radiometry.findings import Raised, Reason
from radiometry.frame.verdicts import ReviewedFrame, Verdict, assume_whole_frame, conclude, inspect_frames
from radiometry.geometry import codes
from radiometry.geometry.features import Features
from radiometry.geometry.rows import CHART, FrameRow

BLURRED_RISE_PX: Final = 5.0
SMALL_SHARE: Final = 0.05


def judge_frames(frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow]) -> dict[str, Verdict]:
    """Return the verdict on each frame of a campaign.

    Parameters
    ----------
    frames : sequence of ReviewedFrame
        All frames of the campaign; without a region the board is searched in the whole
        frame, and the missing region is not a reason.
    rows : sequence of FrameRow
        Evidence of the campaign's frames.

    Returns
    -------
    dict of str to Verdict
        Verdict by name.

    Notes
    -----
    Reasons, in addition to those of any frame: board_not_found (fail), board_blurred and board_small
    (warn).
    """
    reasons = inspect_frames([assume_whole_frame(frame) for frame in frames])
    for row in rows:
        if row.role == CHART and row.features is not None and row.frame in reasons:
            reasons[row.frame] += _inspect(row.features)
    return {frame: conclude(found) for frame, found in reasons.items()}


def check_features(features: Features) -> list[Raised]:
    """Return the flags of a picture that was searched for its board."""
    return [codes.BOARD_NOT_FOUND.at("", features.not_found)] if features.not_found else []


def _inspect(features: Features) -> list[Reason]:
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
