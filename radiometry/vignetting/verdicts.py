"""Verdicts on the frames of a campaign, and what it lacks for a good fit."""

import itertools
import math
from collections import Counter
from collections.abc import Sequence

from radiometry.drawing.text import name_few
from radiometry.findings import Reason, shared
from radiometry.frame.verdicts import ReviewedFrame, Verdict, assume_whole_frame, conclude, inspect_frames
from radiometry.specification.roles import Gap
from radiometry.vignetting import blocks, codes, points, results
from radiometry.vignetting.light import EXPOSURE_RATIO, find_not_dark


def judge(
    frames: Sequence[ReviewedFrame], rows: Sequence[blocks.FrameRow], params: results.Params
) -> dict[str, Verdict]:
    reasons = inspect_frames([assume_whole_frame(frame) for frame in frames])
    for candidate in points.collect_candidates(rows, params):
        if candidate.quality is not None:
            reasons[candidate.row.frame] += _inspect_flat(candidate.quality)
    for row in rows:
        if row.role == results.DARK and (seen := find_not_dark(row)) is not None:
            reasons[row.frame].append(seen)
    return {frame: conclude(found) for frame, found in reasons.items()}


def _inspect_flat(quality: points.Quality) -> list[Reason]:
    if quality.problem:
        return [quality.problem.reason(f"{quality.left_out[0].upper()}{quality.left_out[1:]}.")]
    found = []
    if quality.is_uneven:
        detail = (
            f"The light changes by {quality.gradient_rel or 0.0:.1%} across the frame. Even it out, or turn "
            "the target."
        )
        found.append(shared.UNEVEN.reason(detail, "warn"))
    if quality.signal_share < points.WEAK_SIGNAL_SHARE:
        detail = (
            f"The weakest channel has {quality.signal_share:.1%} of the span from black to white: an error "
            "of the dark signal counts. Expose longer."
        )
        found.append(shared.WEAK_SIGNAL.reason(detail))
    if quality.spots:
        detail = (
            f"{points.describe_spots(quality.spots)} Clean the sensor or move the target, and take it again."
        )
        found.append(codes.DUST.reason(detail, "warn"))
    return found


# Frames at each f-number: what one shows that the others do not is the target's or the light's
GOOD_FLATS = 3

GOOD_DARKS = 3

# Between neighbouring f-numbers, in stops: over a whole stop the interpolation stays within half of what the
# falloff changes; markings are rounded by up to a tenth
WIDEST_GAP_STOPS = 1.1

UNSEEN_GRADIENT_REL = 0.01  # Standard error of the plane of light across the frame


def plan(rows: Sequence[blocks.FrameRow], params: results.Params) -> tuple[str, ...]:
    candidates = points.collect_candidates(rows, params)
    used = [candidate for candidate in candidates if not candidate.left_out]
    spoilt: dict[str, list[str]] = {}
    for each in candidates:
        if each.quality is not None and each.left_out:
            spoilt.setdefault(each.left_out, []).append(each.row.frame)
    advice = [f"take again: {name_few('frame', frames)} ({why})" for why, frames in spoilt.items()]
    by_f_number: dict[float, list[points.Candidate]] = {}
    for candidate in used:
        if candidate.light:
            by_f_number.setdefault(candidate.light.f_number, []).append(candidate)
    advice += _plan_darks(used)
    advice += [
        f"f/{f_number:g} has {_count(len(group), 'usable flat frame')}: add {GOOD_FLATS - len(group)} more"
        for f_number, group in by_f_number.items()
        if len(group) < GOOD_FLATS
    ]
    seen = [each.quality.gradient_u_rel or 0.0 for each in used if each.quality]
    if seen and min(seen) > UNSEEN_GRADIENT_REL and params.flats_turned_deg is None:
        advice.append(
            f"uneven light is known to {min(seen):.1%} at best, beside an off-centre lens: turn the camera "
            "by half or a quarter of a turn between flats, and state the angle in the fit"
        )
    return (*advice, *_plan_f_numbers(sorted(by_f_number)))


def find_gaps(rows: Sequence[blocks.FrameRow], params: results.Params) -> tuple[Gap, ...]:
    lights = [
        each.light for each in points.collect_candidates(rows, params) if not each.left_out and each.light
    ]
    counts = Counter(light.f_number for light in lights)
    f_numbers = sorted(counts)
    between = [
        float(f"{math.sqrt(lower * higher):.2g}")
        for lower, higher in itertools.pairwise(f_numbers)
        if 2.0 * math.log2(higher / lower) > WIDEST_GAP_STOPS
    ]
    lacking = {f_number: GOOD_FLATS - counts[f_number] for f_number in (*f_numbers, *between)}
    return tuple(
        Gap(role="flat", at={"f_number": f_number}, text="Flat frame")
        for f_number, count in lacking.items()
        for _ in range(count)
    )


def _plan_darks(used: Sequence[points.Candidate]) -> list[str]:
    advice = []
    lights = [(each.row.exposure, each.light) for each in used if each.row.exposure and each.light]
    for iso in sorted({exposure.iso for exposure, _ in lights}):
        of_iso = [light for exposure, light in lights if exposure.iso == iso]
        fewest = min(light.dark_frames for light in of_iso)
        slowest = max((light.dark_time_ratio or 1.0 for light in of_iso), default=1.0)
        if fewest == 0:
            advice.append(f"no dark frames at ISO {iso:g}: add {GOOD_DARKS} with the lens covered")
        elif slowest > EXPOSURE_RATIO:
            advice.append(
                f"no dark frames at ISO {iso:g} within a factor of two of every flat's exposure time"
            )
        elif fewest < GOOD_DARKS:
            advice.append(f"ISO {iso:g} has {_count(fewest, 'dark frame')}: add {GOOD_DARKS - fewest}")
    return advice


def _plan_f_numbers(f_numbers: Sequence[float]) -> list[str]:
    if len(f_numbers) == 1:
        return [f"only f/{f_numbers[0]:g}: frames at other f-numbers cannot be corrected"]
    return [
        f"f/{lower:g} and f/{higher:g} are more than a stop apart: add one between"
        for lower, higher in itertools.pairwise(f_numbers)
        if 2.0 * math.log2(higher / lower) > WIDEST_GAP_STOPS
    ]


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
