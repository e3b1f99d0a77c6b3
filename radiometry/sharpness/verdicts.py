"""Verdict on every frame of a sharpness campaign, and suggestions for a good fit."""

from collections.abc import Sequence

from radiometry.findings import Reason
from radiometry.findings.grouping import Cause
from radiometry.frame.verdicts import ReviewedFrame, Verdict, conclude, inspect_frames
from radiometry.sharpness import codes
from radiometry.sharpness.fit import CENTRE_RADIUS_REL, CORNER_RADIUS_REL
from radiometry.sharpness.positions import Candidate, collect_candidates, merge_position
from radiometry.sharpness.results import FrameRow, Params, PositionFit

GOOD_REPEATS = 3
BLURRED_REL = 0.1
_BLURRED_ERRORS = 3.0


def judge(frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow], params: Params) -> dict[str, Verdict]:
    """Return the verdict on each frame of a campaign.

    Reasons, each of them a warning: `chart_unusable` if some channel of some region has no response;
    `blurred` if at a position the frame is a tenth and three standard uncertainties below the best of its
    repeats.
    """
    reasons = inspect_frames(frames)
    candidates = collect_candidates(rows, params)
    for each in candidates:
        if each.response is None and each.frame in reasons:
            where = f"Region {each.region.name}: " if each.region.name else ""
            reasons[each.frame].append(codes.CHART_UNUSABLE.reason(f"{where}{each.left_out}"))
    for key in sorted({each.key for each in candidates}):
        for frame, reason in _find_blurred([each for each in candidates if each.key == key], params):
            if frame in reasons:
                reasons[frame].append(reason)
    return {frame: conclude(found) for frame, found in reasons.items()}


def _find_blurred(repeats: Sequence[Candidate], params: Params) -> list[tuple[str, Reason]]:
    measured = [(each, found) for each in repeats if (found := each.measure(params)) is not None]
    if len(measured) < 2:
        return []
    best = max((found for _, found in measured), key=lambda found: found.value)
    blurred = []
    for each, found in measured:
        u = (found.standard_uncertainty**2 + best.standard_uncertainty**2) ** 0.5
        if best.value - found.value > max(BLURRED_REL * best.value, _BLURRED_ERRORS * u):
            detail = (
                f"Region {each.region.name or 'of the frame'}, channel {each.channel}: {found.value:.3f} "
                "cycles per pixel, "
                f"another frame has {best.value:.3f}. Camera or chart moved, or the focus did: take it again."
            )
            blurred.append((each.frame, codes.BLURRED.reason(detail)))
    return blurred


def plan(rows: Sequence[FrameRow], params: Params) -> tuple[str, ...]:
    usable = [each for each in collect_candidates(rows, params) if not each.left_out]
    keys = sorted({each.key for each in usable})
    positions = [merge_position([each for each in usable if each.key == key], params) for key in keys]
    found = [*_plan_repeats(positions), *_plan_places(positions), *_plan_directions(positions)]
    if positions and params.pixel_pitch_um is None:
        lacking = "no pixel pitch: nothing can be said in line pairs per millimetre"
        found.append(Cause(lacking, codes.PIXEL_PITCH_MISSING))
    return tuple(found)


def _plan_repeats(positions: Sequence[PositionFit]) -> list[str]:
    frames: dict[str, int] = {}
    for each in positions:
        frames[each.position] = max(frames.get(each.position, 0), each.frames)
    few = sorted((name, count) for name, count in frames.items() if count < GOOD_REPEATS)
    return [
        f"position {name or 'of the frame'} has {count} usable frame{'s' if count > 1 else ''}: "
        f"add {GOOD_REPEATS - count} for its repeatability"
        for name, count in few
    ]


def _plan_places(positions: Sequence[PositionFit]) -> list[str]:
    if not positions:
        return []
    found = []
    if all(each.radius_rel > CENTRE_RADIUS_REL for each in positions):
        found.append("no position near the middle of the frame: the falloff cannot be given")
    if all(each.radius_rel < CORNER_RADIUS_REL for each in positions):
        found.append("no position near a corner of the frame: the falloff cannot be given")
    return found


def _plan_directions(positions: Sequence[PositionFit]) -> list[str]:
    orientations = {each.orientation for each in positions if each.orientation}
    if len(orientations) == 1:
        (only,) = orientations
        other = "horizontal" if only == "vertical" else "vertical"
        return [f"all edges are {only}: add a {other} one, a lens may blur one way more than the other"]
    return []
