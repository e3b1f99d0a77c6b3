"""Verdicts on the frames of a campaign, and what it lacks for good coefficients."""

from collections.abc import Sequence

from radiometry.findings import Finding, Outcome, Reason, shared
from radiometry.frame.verdicts import ReviewedFrame, Verdict, assume_whole_frame, conclude, inspect_frames
from radiometry.noise import channels, codes, fit, transfer
from radiometry.noise.results import DARK, FrameRow, Params
from radiometry.noise.stacks import Stack
from radiometry.specification.roles import Gap


def judge(frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow], params: Params) -> dict[str, Verdict]:
    reasons = inspect_frames([assume_whole_frame(frame) for frame in frames])
    found: dict[str, dict[Finding, Reason]] = {}
    for stacks in fit.collect_stacks(rows, params).values():
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
        found += transfer.find_not_dark(stack).items()
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
    if stack.setting.role == DARK or stack.drift_rel <= fit.DRIFT_REL:
        return []
    outcome: Outcome = "fail" if stack.drift_rel > params.largest_drift_rel else "warn"
    detail = (
        f"The means of the frames of this setting differ by {stack.drift_rel:.1%}: the light changed between "
        "them. Let the lamp warm up, and take them one right after the other."
    )
    return [codes.PAIR_DRIFT.reason(detail, outcome)]


# EMVA 1288 asks for at least nine levels between 5 and 95 % of saturation for the linearity error
GOOD_LEVELS = 9

# Frames of one setting for DSNU and PRNU: the temporal noise that is left is a quarter of one frame's
GOOD_STACK = 16


def plan(rows: Sequence[FrameRow], params: Params) -> tuple[str, ...]:
    gravest: list[str] = []
    others: list[str] = []
    for (iso, _), stacks in fit.collect_stacks(rows, params).items():
        where = f"ISO {iso:g}"
        fitted = channels.fit_channel(stacks, params)
        if fitted is None:
            gravest.append(f"{where} has no pair of dark frames: add two of one exposure time, lens covered")
            continue
        gravest += _plan_levels(where, fitted)
        others += _plan_darks(where, stacks) + _plan_patterns(where, fitted)
    return tuple(dict.fromkeys([*gravest, *others]))


def find_gaps(rows: Sequence[FrameRow], params: Params) -> tuple[Gap, ...]:
    gaps: dict[tuple[str, float], Gap] = {}
    for (iso, _), stacks in fit.collect_stacks(rows, params).items():
        fitted = channels.fit_channel(stacks, params)
        if fitted is None:
            gaps["dark", iso] = Gap(role=DARK, at={"iso": iso}, text="Two of one time")
            continue
        short = GOOD_LEVELS - sum(not level.left_out for level in fitted.levels)
        if short > 0:
            gaps["flat", iso] = Gap(role="flat", at={"iso": iso}, text=f"Pairs at {short} more times")
    return tuple(gaps.values())


def _plan_levels(where: str, fitted: channels.FittedChannel) -> list[str]:
    name = f"{where} {fitted.fit.channel}"
    usable = sum(not level.left_out for level in fitted.levels)
    if fitted.transfer is None:
        return [f"{name} has {usable} usable levels: add pairs at {max(1, 3 - usable)} more exposure times"]
    found = []
    if usable < GOOD_LEVELS:
        found.append(f"{name} has {usable} usable levels: add {GOOD_LEVELS - usable} more up to white")
    if fitted.fit.transfer and fitted.fit.transfer.saturation_origin == "white_level_assumed":
        found.append(f"{name} was never saturated: add a pair that reaches white")
    if fitted.fit.linearity is None:
        found.append(f"{name} has no four exposure times of one scene and f-number: no linearity error")
    return found


def _plan_darks(where: str, stacks: Sequence[Stack]) -> list[str]:
    times = {stack.setting.exposure_time_s for stack in stacks if stack.setting.role == DARK}
    if len(times) > 1:
        return []
    return [
        f"{where} has dark frames of one exposure time: add some of a much longer one for the dark current"
    ]


def _plan_patterns(where: str, fitted: channels.FittedChannel) -> list[str]:
    found = []
    if not fitted.dsnu_resolved:
        found.append(f"{where}: add dark frames of one setting up to {GOOD_STACK} for the DSNU")
    if not fitted.prnu_resolved or (fitted.transfer and fitted.fit.prnu_rel is None):
        found.append(
            f"{where}: add frames about half of white of one setting up to {GOOD_STACK} for the PRNU"
        )
    return found
