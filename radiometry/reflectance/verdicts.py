"""Verdict on every frame of a reflectance campaign, and advice for a good fit."""

from collections.abc import Sequence
from dataclasses import replace

from radiometry.findings import InputRejected, Reason, interface, shared
from radiometry.frame.verdicts import ReviewedFrame, Verdict, conclude, inspect_frames
from radiometry.reflectance import codes
from radiometry.reflectance.findings import STEEPEST_GRADIENT_REL
from radiometry.reflectance.panel import describe_difference
from radiometry.reflectance.points import (
    MOST_SATURATED_SHARE,
    NO_REFLECTANCE,
    PANEL,
    Candidate,
    collect_candidates,
)
from radiometry.reflectance.rows import FrameRow, Params, Reading
from radiometry.reflectance.sunshine import measure_sunshine


def judge(
    frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> dict[str, Verdict]:
    """Judge each frame of a campaign.

    Returns
    -------
    dict of str to Verdict
        Verdict by name of the frame. Reasons beyond those of any frame: `clipped`,
        `panel_uneven`, `panel_weak`, `panel_unknown`, `panel_differs` of a panel frame;
        `sunshine_unusable` and `sunshine_second_channel` of any.
    """
    reasons = inspect_frames(frames)
    for each in collect_candidates(rows, readings, replace(params, normalisation="panel_only", exclude=())):
        if each.row.features is not None:
            reasons[each.row.frame] += _inspect_panel(each)
        if difference := describe_difference(each.row, readings):
            detail = f"{difference} {interface.PANEL_DIFFERS.remedy}"
            reasons[each.row.frame].append(interface.PANEL_DIFFERS.reason(detail))
    if params.normalisation == "sunshine":
        for row in rows:
            reasons[row.frame] += _inspect_sunshine(row, params)
    return {frame: conclude(found) for frame, found in reasons.items()}


def _inspect_panel(candidate: Candidate) -> list[Reason]:
    features, found = candidate.features, []
    saturated = features.statistics.saturated_share
    if saturated > MOST_SATURATED_SHARE:
        detail = (
            f"{saturated:.1%} of the panel is saturated: the fit leaves the frame out. "
            "Shorten the exposure and take the panel again."
        )
        found.append(shared.CLIPPED.reason(detail))
    elif candidate.left_out and candidate.left_out != NO_REFLECTANCE:
        detail = f"The panel gives no usable signal ({candidate.left_out}): take it again in better light."
        found.append(codes.PANEL_WEAK.reason(detail))
    if features.gradient_rel > STEEPEST_GRADIENT_REL:
        detail = (
            f"The signal changes by {features.gradient_rel:.1%} across the region: a shadow, a reflection or "
            "the panel's rim. Draw the region within the panel, or take the panel again in even light."
        )
        found.append(codes.PANEL_UNEVEN.reason(detail))
    if candidate.left_out == NO_REFLECTANCE:
        detail = (
            f"The panel's reflectance in band {candidate.band.band} is not known: "
            "register the panel with this band and name it in the campaign."
        )
        found.append(codes.PANEL_UNKNOWN.reason(detail))
    return found


def _inspect_sunshine(row: FrameRow, params: Params) -> list[Reason]:
    band = row.header.multispectral
    if band is None:
        return []
    try:
        found = measure_sunshine(band, choice=params.sunshine_choice)
    except InputRejected as rejected:
        return [codes.SUNSHINE_UNUSABLE.reason(rejected.message)]
    second = codes.SUNSHINE_SECOND_CHANNEL
    return [
        second.reason(f"{second.sentence} {raised.detail} {second.remedy}")
        for raised in found.flags
        if raised.flag == second
    ]


def plan(rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params) -> tuple[str, ...]:
    """List by name what would improve the fit."""
    collected = collect_candidates(rows, readings, params)
    candidates = [each for each in collected if not each.left_out]
    advice: list[str] = []
    shown = {row.header.multispectral.band for row in rows if row.header.multispectral is not None}
    if any(row.role == PANEL for row in rows):
        # a region or a reflectance that is lacking is asked for by itself
        waiting = {each.frame for each in rows if each.features is None}
        seen = {
            each.band.band
            for each in collected
            if each.left_out in {"", NO_REFLECTANCE} or each.row.frame in waiting
        }
        if unseen := ", ".join(sorted(shown - seen)):
            advice.append(f"no panel frame can be used (band {unseen})")
    if candidates and len({each.visit for each in candidates}) == 1:
        advice.append("the panel was photographed once: take it after the flight too, to see the drift")
    if any(each.panel is not None and not each.panel.states_uncertainty for each in candidates):
        advice.append("the panel states no uncertainty: register it with that of its certificate")
    return tuple(advice)
