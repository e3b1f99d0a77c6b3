"""Verdict on every frame of a vignetting campaign, from the same evidence that its fit uses."""

from collections.abc import Sequence

from radiometry.findings import Reason, shared
from radiometry.frame.verdicts import ReviewedFrame, Verdict, assume_whole_frame, conclude, inspect_frames
from radiometry.vignetting import codes
from radiometry.vignetting.darkness import find_not_dark
from radiometry.vignetting.features import FrameRow
from radiometry.vignetting.points import collect_candidates
from radiometry.vignetting.quality import WEAK_SIGNAL_SHARE, Quality, describe_spots
from radiometry.vignetting.rows import DARK, Params


def judge(frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow], params: Params) -> dict[str, Verdict]:
    """Return the verdict on each frame of a campaign."""
    reasons = inspect_frames([assume_whole_frame(frame) for frame in frames])
    for candidate in collect_candidates(rows, params):
        if candidate.quality is not None:
            reasons[candidate.row.frame] += _inspect_flat(candidate.quality)
    for row in rows:
        if row.role == DARK and (seen := find_not_dark(row)) is not None:
            reasons[row.frame].append(seen)
    return {frame: conclude(found) for frame, found in reasons.items()}


def _inspect_flat(quality: Quality) -> list[Reason]:
    if quality.problem:
        detail = f"{quality.left_out[0].upper()}{quality.left_out[1:]}."
        return [quality.problem.reason(detail)]
    found = []
    if quality.is_uneven:
        detail = (
            f"The light changes by {quality.gradient_rel or 0.0:.1%} across the frame. Even it out, or turn "
            "the target."
        )
        found.append(shared.UNEVEN.reason(detail, "warn"))
    if quality.signal_share < WEAK_SIGNAL_SHARE:
        detail = (
            f"The weakest channel has {quality.signal_share:.1%} of the span from black to white: an error "
            "of the dark signal counts. Expose longer."
        )
        found.append(shared.WEAK_SIGNAL.reason(detail))
    if quality.spots:
        detail = f"{describe_spots(quality.spots)} Clean the sensor or move the target, and take it again."
        found.append(codes.DUST.reason(detail, "warn"))
    return found
