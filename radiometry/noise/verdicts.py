"""Verdict on every frame of a noise campaign, from the same evidence that its fit uses."""

from collections.abc import Sequence

from radiometry.findings import Finding, Outcome, Reason, shared
from radiometry.frame.verdicts import ReviewedFrame, Verdict, assume_whole_frame, conclude, inspect_frames
from radiometry.noise import codes
from radiometry.noise.blocks import FrameRow
from radiometry.noise.darkness import find_not_dark
from radiometry.noise.findings import DRIFT_REL
from radiometry.noise.points import collect_stacks
from radiometry.noise.rows import DARK, Params
from radiometry.noise.stacks import Stack


def judge(frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow], params: Params) -> dict[str, Verdict]:
    """Return the verdict on each frame of a campaign.

    Returns
    -------
    dict of str to Verdict
        Verdict by name; a reason of several channels is listed once.
    """
    reasons = inspect_frames([assume_whole_frame(frame) for frame in frames])
    found: dict[str, dict[Finding, Reason]] = {}
    for stacks in collect_stacks(rows, params).values():
        for stack in stacks:
            for frame, reason in _inspect(stack, params):
                found.setdefault(frame, {}).setdefault(reason.code, reason)
    for frame, by_code in found.items():
        reasons[frame] += by_code.values()
    return {frame: conclude(each) for frame, each in reasons.items()}


def _inspect(stack: Stack, params: Params) -> list[tuple[str, Reason]]:
    found = [
        (copy, shared.REDUNDANT.reason(f"Its samples are those of {original}: it is a copy."))
        for copy, original in stack.copies.items()
    ]
    of_all = _inspect_pairing(stack, params)
    if stack.setting.role == DARK:
        found += find_not_dark(stack).items()
    elif stack.clipped:
        detail = (
            f"{stack.clipped_share:.1%} of {stack.setting.channel} is at white: that shows where the signal "
            "ends, and no noise. Expose the others shorter."
        )
        of_all.append(shared.CLIPPED.reason(detail, "warn"))
    return [*found, *((frame, reason) for frame in stack.frames for reason in of_all)]


def _inspect_pairing(stack: Stack, params: Params) -> list[Reason]:
    if stack.temporal is None:
        detail = (
            "No other frame has its role, scene, ISO, exposure time and f-number: noise is seen between two "
            "frames alike. Take it again with the same settings."
        )
        return [codes.UNPAIRED.reason(detail)]
    if stack.setting.role == DARK or stack.drift_rel <= DRIFT_REL:
        return []
    outcome: Outcome = "fail" if stack.drift_rel > params.largest_drift_rel else "warn"
    detail = (
        f"The means of the frames of this setting differ by {stack.drift_rel:.1%}: the light changed between "
        "them. Let the lamp warm up, and take them one right after the other."
    )
    return [codes.PAIR_DRIFT.reason(detail, outcome)]
