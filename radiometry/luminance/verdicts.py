"""Verdict on every frame of a luminance campaign, from the same evidence that its fit will use."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from radiometry.findings import Reason
from radiometry.fitting.evidence import Exclusion
from radiometry.frame.statistics import ChannelStatistics, select_rows
from radiometry.frame.verdicts import ReviewedFrame, Verdict, conclude, inspect_frames
from radiometry.luminance.agreement import (
    expect_signals,
    find_repeats,
    inspect_agreement,
    inspect_scenes,
    measure_brightness,
)
from radiometry.luminance.darkness import inspect_darks, name_unusable
from radiometry.luminance.evenness import inspect_evenness
from radiometry.luminance.exposure import inspect_exposure
from radiometry.luminance.points import IsoSeries, collect_series
from radiometry.luminance.rows import FrameRow, Params, Reading


def judge(
    frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> dict[str, Verdict]:
    """Judge each frame of a campaign.

    Notes
    -----
    Light frames are judged by dark frames without an elevated dark signal, so that
    one mistake is reported once.
    """
    reasons = inspect_frames(frames)
    darks = inspect_darks(rows, params)
    unusable = frozenset(name_unusable(rows, darks))
    _add(reasons, darks, inspect_scenes(rows, readings, params), find_repeats(rows, params))
    if without := tuple(Exclusion(frame=each, reason="saw light", by="verdict") for each in sorted(unusable)):
        params = replace(params, exclude=params.exclude + without)
    for series in collect_series(rows, readings, params):
        _add(reasons, *_inspect_series(series, rows, params, unusable=unusable))
    return {frame: conclude(found) for frame, found in reasons.items()}


def _add(reasons: dict[str, list[Reason]], *parts: Mapping[str, Sequence[Reason]]) -> None:
    for part in parts:
        for frame, found in part.items():
            reasons[frame].extend(found)


def _inspect_series(
    series: IsoSeries, rows: Sequence[FrameRow], params: Params, *, unusable: frozenset[str]
) -> list[dict[str, list[Reason]]]:
    channel, brightness = params.channel, measure_brightness(series)
    expected = expect_signals(series, brightness)
    exposing = {
        candidate.frame: found
        for candidate in series.candidates
        if (found := inspect_exposure(candidate, channel, expected_signal_dn=expected.get(candidate.frame)))
    }
    # a tone curve bends noise, and a table may not state it
    rendered = {row.frame for row in rows if row.rendered or row.from_table}
    darks = [
        select_rows(row.statistics, channel=channel)
        for row in rows
        if row.role == "dark"
        and row.statistics
        and row.exposure.iso == series.iso
        and row.frame not in unusable
    ]
    linear = [candidate for candidate in series.candidates if candidate.frame not in rendered]
    evenness = inspect_evenness(linear, channel, dark_std_dn=_quietest(darks))
    return [exposing, evenness, inspect_agreement(brightness)]


def _quietest(darks: Sequence[Sequence[ChannelStatistics]]) -> float:
    """Return the noise of the quietest dark frame [DN], 0 if there is none."""
    return min((math.sqrt(math.fsum(r.std_dn**2 for r in rows) / len(rows)) for rows in darks), default=0.0)
