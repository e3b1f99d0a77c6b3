"""Frames of a noise campaign: those that are used, those that are left out and why, and what is missing."""

from collections.abc import Sequence

from radiometry.drawing.text import name_few
from radiometry.noise.blocks import FrameRow
from radiometry.noise.fit import FittedChannel
from radiometry.noise.results import Point
from radiometry.noise.rows import DARK, Params
from radiometry.noise.stacks import Stack, group_by_channel, make_stacks
from radiometry.noise.transfer import FEWEST_LEVELS


def collect_stacks(rows: Sequence[FrameRow], params: Params) -> dict[tuple[float, str], list[Stack]]:
    """Return the stacks of the frames that are not excluded, by ISO value and channel.

    Returns
    -------
    dict of tuple of (float, str) to list of Stack
        Stacks by ISO value and channel.
    """
    excluded = {exclusion.frame for exclusion in params.exclude}
    return group_by_channel(make_stacks([row for row in rows if row.frame not in excluded]))


def missing(rows: Sequence[FrameRow], params: Params, *, unread: Sequence[str] = ()) -> tuple[str, ...]:
    """List, by name, what keeps a fit from starting."""
    excluded = {exclusion.frame for exclusion in params.exclude}
    here = [row for row in rows if row.frame not in excluded]
    waiting = [row.frame for row in here if row.features is None]
    lacking = [
        f"{what}: {name_few('frame', group)}"
        for group, what in ((unread, "not read yet"), (waiting, "not extracted yet"))
        if group
    ]
    if lacking:
        return tuple(lacking)
    by_channel = collect_stacks(rows, params)
    complaints = [_complain(iso, channel, stacks) for (iso, channel), stacks in by_channel.items()]
    if not complaints:
        return ("no frame: take pairs of dark and of evenly lit frames at several exposure times",)
    # one channel at one ISO value is enough to start
    return () if "" in complaints else tuple(dict.fromkeys(complaints))


def _complain(iso: float, channel: str, stacks: Sequence[Stack]) -> str:
    """Return what one channel lacks; "" if a photon transfer can be tried."""
    paired = [stack for stack in stacks if stack.temporal is not None]
    if not any(stack.setting.role == DARK for stack in paired):
        return f"ISO {iso:g} has no pair of dark frames of one exposure time"
    levels = sum(stack.setting.role != DARK and not stack.clipped for stack in paired)
    if levels < FEWEST_LEVELS:
        return (
            f"ISO {iso:g} {channel} has pairs of frames at {levels} light levels below white: "
            f"at least {FEWEST_LEVELS}"
        )
    return ""


def describe_points(
    rows: Sequence[FrameRow],
    stacks: Sequence[Stack],
    fitted: Sequence[FittedChannel],
    params: Params,
) -> tuple[Point, ...]:
    """Return, for every channel of every frame, whether it was used.

    Parameters
    ----------
    rows : sequence of FrameRow
        Evidence of the campaign's frames.
    stacks : sequence of Stack
        Stacks of all channels.
    fitted : sequence of FittedChannel
        Fitted channels.
    params : Params
        Parameters of the fit.

    Returns
    -------
    tuple of Point
        Points in the order of the names.
    """
    excluded = {each.frame: f"excluded by {each.by}: {each.reason}" for each in params.exclude}
    states = _judge_stacks(stacks, fitted)
    points = []
    for row in sorted(rows, key=lambda row: row.frame):
        reason = excluded.get(row.frame) or ("" if row.features and row.exposure else "not extracted")
        if reason:
            points.append(_describe(row, None, "", reason))
            continue
        own = [stack for stack in stacks if row.frame in stack.frames or row.frame in stack.copies]
        for stack in own:
            original = stack.copies.get(row.frame)
            why = f"its samples are those of {original}: a copy" if original else states[stack.setting]
            points.append(_describe(row, stack, stack.setting.channel, why))
    return tuple(points)


def _judge_stacks(stacks: Sequence[Stack], fitted: Sequence[FittedChannel]) -> dict[object, str]:
    """Return, for every stack, the reason why nothing was evaluated from it, "" if something was."""
    states: dict[object, str] = {
        stack.setting: "" if stack.setting.role == DARK else "no pair of dark frames at its ISO"
        for stack in stacks
    }
    for each in fitted:
        for level, result in zip(each.levels, each.fit.levels, strict=True):
            used = not result.left_out or result.deviation_rel is not None
            states[level.lit.setting] = "" if used else result.left_out
    return states


def _describe(row: FrameRow, stack: Stack | None, channel: str, left_out: str) -> Point:
    exposure = row.exposure
    mean = None
    if stack is not None and row.frame in stack.frames:
        mean = stack.frame_means_dn[stack.frames.index(row.frame)]
    return Point(
        frame=row.frame,
        channel=channel,
        role=row.role,
        scene=row.scene,
        iso=exposure.iso if exposure else None,
        f_number=exposure.f_number if exposure else None,
        exposure_time_s=exposure.exposure_time_s if exposure else None,
        mean_dn=mean,
        clipped_share=stack.clipped_share if stack else None,
        frames_of_setting=len(stack.frames) if stack else 0,
        used=not left_out,
        left_out=left_out,
    )
