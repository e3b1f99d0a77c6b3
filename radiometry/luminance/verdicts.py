"""Verdict on every frame of a luminance campaign, from the same evidence that its fit will use."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from statistics import NormalDist

from radiometry.drawing.text import name_few, sort_naturally, write_exposure
from radiometry.findings import Reason, shared
from radiometry.fitting.evidence import Exclusion
from radiometry.frame import exposure, statistics, verdicts
from radiometry.frame.verdicts import ReviewedFrame, Verdict
from radiometry.luminance import codes, points
from radiometry.luminance.brightness import (
    USEFUL_SHARE,
    expect_signals,
    find_doubted,
    inspect_agreement,
    measure_brightness,
)
from radiometry.luminance.points import Candidate, IsoSeries
from radiometry.luminance.rows import FrameRow, Params, Reading
from radiometry.luminance.scenes import check_scenes, summarise_scenes

ABOVE_OTHERS_SHARE = 0.001
"""Of the span from black to white, above the darkest dark frame of the same ISO and a like time: a tenth of
the weakest useful signal. Dark frames of one time differ by noise and by a wandering black level, together
about a tenth of this."""

NEAR_WHITE_SHARE = 0.95
"""Of the span from dark to white. The last 5 % are where sensors bend first, and a lamp that rises by as
much would clip the next frame."""

AIM_SHARE = 0.80
"""Where the highlights should come to lie: a quarter of a stop below `NEAR_WHITE_SHARE`, which is what a
camera that moves in thirds of a stop can hit."""

USEFUL_ERRORS = 50.0
"""Standard errors above dark: one is then 2 % of the signal, half of the tolerance of 4 %."""

_UNKNOWN_EXCESS = 4.0
"""Told of a region of which most is clipped: two stops, after which the next frame shows how many more."""

_HIGHLIGHT_SIGMAS = NormalDist().inv_cdf(1.0 - points.MOST_SATURATED_SHARE)
_LESS = "a shorter time, a smaller aperture (larger f-number) or a lower ISO"
_MORE = "a longer time, a larger aperture (smaller f-number) or a brighter level"
UNEVEN_REL = 0.05
"""Standard deviation of the light over the region, of its mean. A meter's spot somewhere in the region then
differs from the region's mean by about as much, more than the tolerance of 4 %. A slope has it when one end
is 17 % brighter than the other."""

SKEWED_REL = 0.02
"""Distance of mean and median, of the signal: half of the tolerance. A tape or an edge that takes 2 % of the
region and gives no light reaches it."""

JUDGED_SHARE = 0.05
"""Of the span from dark to white. In a weaker signal, what read noise differs between frames looks like
unevenness: a fifth of it, at 3 DN, would be 9 % of a signal of 1 %, and is 1 % here."""

_ERRORS = 3.0
_NORMAL_MEDIAN = math.sqrt(math.pi / 2 - 1)
"""Standard error of mean minus median in units of the mean's, of a normal distribution."""

_ROUNDING_DN = 0.5
_THIRDS = ("", " 1/3", " 2/3")


def judge(
    frames: Sequence[ReviewedFrame], rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> dict[str, Verdict]:
    """Judge each frame of a campaign.

    Light frames are judged by dark frames without an elevated dark signal, so that one mistake is reported
    once.
    """
    reasons = verdicts.inspect_frames(frames)
    darks = inspect_darks(rows, params)
    unusable = frozenset(name_unusable(rows, darks))
    _add(reasons, darks, inspect_scenes(rows, readings, params), find_repeats(rows, params))
    if without := tuple(Exclusion(frame=each, reason="saw light", by="verdict") for each in sorted(unusable)):
        params = replace(params, exclude=params.exclude + without)
    every = points.collect_series(rows, readings, params)
    for series in every:
        _add(reasons, *_inspect_series(series, rows, params, unusable=unusable))
    for doubted in find_doubted(every, readings):
        if doubted.is_grave:
            reason = codes.READING_OFF.reason(f"{doubted.describe()}. {codes.READING_OFF.remedy}")
            _add(reasons, {frame: [reason] for frame in doubted.frames})
    return {frame: verdicts.conclude(found) for frame, found in reasons.items()}


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
        statistics.select_rows(row.statistics, channel=channel)
        for row in rows
        if row.role == "dark"
        and row.statistics
        and row.exposure.iso == series.iso
        and row.frame not in unusable
    ]
    linear = [candidate for candidate in series.candidates if candidate.frame not in rendered]
    stds_dn = (math.sqrt(math.fsum(r.std_dn**2 for r in rows) / len(rows)) for rows in darks)
    evenness = inspect_evenness(linear, channel, dark_std_dn=min(stds_dn, default=0.0))
    return [exposing, evenness, inspect_agreement(brightness)]


def inspect_darks(rows: Sequence[FrameRow], params: Params) -> dict[str, list[Reason]]:
    """Find the dark frames with an elevated dark signal.

    A dark frame is compared with the darkest of its ISO value whose time is within a factor of two, because
    dark current grows with time. It is also compared with the black level, if the file states one: if the
    lamp was on in all of them, they agree with each other.
    """
    darks = [row for row in rows if row.role == "dark" and row.statistics]
    signals = {row.frame: row.measure(params.channel) for row in darks}
    by_iso: dict[float, list[FrameRow]] = {}
    for row in darks:
        by_iso.setdefault(row.exposure.iso, []).append(row)
    found = {}
    for group in by_iso.values():
        times = {r.frame: r.exposure.on_basis(params.exposure_basis).exposure_time_s for r in group}
        group.sort(key=lambda row: (signals[row.frame].value_dn, row.frame))
        for row in group:
            time_s = times[row.frame]
            darkest = next(
                r for r in group if points.time_ratio(times[r.frame], [time_s]) <= points.EXPOSURE_RATIO
            )
            signal = signals[row.frame]
            reason = _above_others(row, darkest, signals) or verdicts.inspect_black(
                signal.value_dn, black_level_dn=signal.black_level_dn, white_level_dn=signal.white_level_dn
            )
            if reason is not None:
                found[row.frame] = [reason]
    return found


def name_unusable(rows: Sequence[FrameRow], found: Mapping[str, Sequence[Reason]]) -> list[str]:
    """Name the dark frames by which light frames are not judged, so that one mistake is reported once."""
    unusable = {frame for frame, reasons in found.items() if reasons[0].outcome == "fail"}
    for iso in {row.exposure.iso for row in rows if row.frame in unusable}:
        group = [row for row in rows if row.role == "dark" and row.statistics and row.exposure.iso == iso]
        left = [row for row in group if row.frame not in unusable]
        left.sort(key=lambda row: (row.measure("green").value_dn, row.frame))
        unusable |= {row.frame for row in left[1:]}
    return sorted(unusable)


def _above_others(row: FrameRow, darkest: FrameRow, signals: dict[str, statistics.Signal]) -> Reason | None:
    signal, least = signals[row.frame], signals[darkest.frame]
    excess = signal.value_dn - least.value_dn
    error = math.hypot(signal.standard_uncertainty_dn, least.standard_uncertainty_dn)
    if excess <= max(
        ABOVE_OTHERS_SHARE * max(signal.white_level_dn - signal.black_level_dn, 1.0),
        points.DETECTION_ERRORS * error,
    ):
        return None
    detail = (
        f"Its mean is {excess:.3g} DN above that of {darkest.frame}, a dark frame of the same ISO and a like "
        f"time: this one saw light. {verdicts.TAKE_AGAIN}"
    )
    return shared.DARK_NOT_DARK.reason(detail)


def inspect_exposure(candidate: Candidate, channel: str, *, expected_signal_dn: float | None) -> list[Reason]:
    """Check whether a light frame has too much or too little light, and by how many stops.

    The highlights are where a normal distribution has 0.1 % above it, mean + 3.09 std, and never above the
    largest sample. For a clipped region they are where a distribution with its median and its clipped
    fraction has 0.1 % above it.
    """
    given = channel, expected_signal_dn
    return candidate.keep("exposure", given, _inspect, candidate, *given)


def _inspect(candidate: Candidate, channel: str, expected_signal_dn: float | None) -> list[Reason]:
    dark, span, rows = candidate.dark, candidate.span_dn, candidate.select_rows(channel)
    if points.is_saturated(candidate.signal):
        return [_clipped(candidate, rows, expected_signal_dn)]
    highlights = max(min(row.max_dn, row.mean_dn + _HIGHLIGHT_SIGMAS * row.std_dn) for row in rows)
    if highlights - dark.signal_dn >= NEAR_WHITE_SHARE * span:
        share = (highlights - dark.signal_dn) / span
        detail = (
            f"The highlights of the region reach {min(share, 1.0):.0%} of white. Give it "
            f"{show_stops(share / AIM_SHARE)} less light: {_LESS}."
        )
        return [codes.NEARLY_CLIPPED.reason(detail)]
    return _inspect_weakness(candidate)


def _inspect_weakness(candidate: Candidate) -> list[Reason]:
    adjusted = candidate.above_dark_dn
    error = points.signal_error_dn(candidate.signal, candidate.dark)
    useful = max(USEFUL_SHARE * candidate.span_dn, USEFUL_ERRORS * error)
    if points.is_below_detection(candidate.signal, candidate.dark):
        # what may be nothing but noise says only how many stops are needed at least
        stops = show_stops(useful / max(adjusted, error))
        detail = (
            f"The signal is {adjusted:.3g} DN above dark, with a standard error of {error:.2g} DN: the fit "
            f"leaves it out. Give it at least {stops} more light: {_MORE}."
        )
        return [shared.TOO_DARK.reason(detail)]
    if adjusted < useful:
        detail = (
            f"The signal is {adjusted:.3g} DN above dark; from {useful:.3g} DN on it is useful. "
            f"Give it {show_stops(useful / adjusted)} more light: {_MORE}."
        )
        return [shared.WEAK_SIGNAL.reason(detail)]
    return []


def _clipped(
    candidate: Candidate, rows: Sequence[statistics.ChannelStatistics], expected_signal_dn: float | None
) -> Reason:
    dark_dn = candidate.dark.signal_dn
    excess = [_estimate_highlights(row) - dark_dn for row in rows if row.saturated_share < 0.5]
    if expected_signal_dn is not None:
        excess.append(expected_signal_dn)
    if len(excess) == 0:
        amount = f"at least {show_stops(_UNKNOWN_EXCESS)}"
    else:
        amount = show_stops(max(1.0, max(excess) / (AIM_SHARE * candidate.span_dn)))
    detail = (
        f"{candidate.signal.saturated_share:.2%} of the region is clipped, more than "
        f"{points.MOST_SATURATED_SHARE:.1%}: the fit leaves it out. Give it {amount} less light: {_LESS}."
    )
    return shared.CLIPPED.reason(detail)


def _estimate_highlights(row: statistics.ChannelStatistics) -> float:
    """Estimate the level that 0.1 % of the samples would exceed if nothing had clipped them [DN]."""
    if row.saturated_share <= 0.0:
        return row.mean_dn + _HIGHLIGHT_SIGMAS * row.std_dn
    clipped_at = NormalDist().inv_cdf(1.0 - row.saturated_share)
    sigma = (row.white_level_dn - row.median_dn) / clipped_at
    return row.median_dn + _HIGHLIGHT_SIGMAS * max(sigma, 0.0)


def inspect_evenness(
    candidates: Sequence[Candidate], channel: str, *, dark_std_dn: float
) -> dict[str, list[Reason]]:
    """Find the light frames of an ISO value that show more than one evenly lit surface.

    The model of the variance is, with S the signal above dark [1]::

        std^2 = std_dark^2 + g S + (u S)^2

    Photon noise g S, with a gain g that no file states, and unevenness u S both add to the dark frames' std.
    For every frame (std^2 - std_dark^2) / S is g or more, so the least of the series is a gain that is never
    too small, and::

        u^2 >= ((std^2 - std_dark^2) / S - g) / S

    This is a lower bound of the unevenness: it shows most of it if the series also contains weak signals, and
    nothing in a single frame. In addition, the mean and median of a surface agree to noise, to rounding, and
    to the skewness of photon noise, g / 6 <= std^2 / (6 S); if they do not, part of the region is something
    else.

    [1] EMVA Standard 1288, release 4.0, 2021, equation for temporal and spatial variance
    """
    given = channel, dark_std_dn
    spreads = [
        (candidate.frame, *spread)
        for candidate in candidates
        if (spread := candidate.keep("spread", given, _measure, candidate, *given))
    ]
    gain = max(0.0, min((most for _, _, most, _, _ in spreads), default=0.0))
    found = {}
    for frame, least, _, adjusted, skew in spreads:
        unevenness = math.sqrt(max(0.0, least - gain) / adjusted)
        if skew is not None and (unevenness > UNEVEN_REL or abs(skew) > SKEWED_REL):
            found[frame] = [_uneven(unevenness, skew)]
    return found


def _measure(
    candidate: Candidate, channel: str, dark_std_dn: float
) -> tuple[float, float, float, float | None] | None:
    """Return the least and the greatest spread, the signal [DN] and its skew; no skew where it is weak."""
    if points.is_saturated(candidate.signal) or points.is_below_detection(candidate.signal, candidate.dark):
        return None
    rows, adjusted = candidate.select_rows(channel), candidate.above_dark_dn
    per_dn, error = _measure_spread(rows, adjusted, dark_std_dn)
    skew = None
    if adjusted >= JUDGED_SHARE * candidate.span_dn:
        skew = max((_measure_skew(row, adjusted) for row in rows), key=abs)
    return per_dn - _ERRORS * error, per_dn + _ERRORS * error, adjusted, skew


def _measure_spread(
    rows: Sequence[statistics.ChannelStatistics], adjusted_dn: float, dark_std_dn: float
) -> tuple[float, float]:
    """Compute (std^2 - std_dark^2) / S and its standard error [DN]: var(std^2) = 2 std^4 / n."""
    variance = math.fsum(row.std_dn**2 for row in rows) / len(rows)
    error = variance * math.sqrt(2.0 / sum(row.n for row in rows))
    return (variance - dark_std_dn**2) / adjusted_dn, error / adjusted_dn


def _measure_skew(row: statistics.ChannelStatistics, adjusted_dn: float) -> float:
    """Compute mean minus median beyond noise, relative to the signal."""
    difference = row.mean_dn - row.median_dn
    noise = _ERRORS * _NORMAL_MEDIAN * row.std_dn / math.sqrt(row.n)
    allowed = noise + row.std_dn**2 / (6.0 * adjusted_dn) + _ROUNDING_DN
    return math.copysign(max(0.0, abs(difference) - allowed), difference) / adjusted_dn


def _uneven(unevenness: float, skew: float) -> Reason:
    said = []
    if unevenness > UNEVEN_REL:
        said.append(f"the light varies over the region by at least {unevenness:.0%} beyond noise")
    if abs(skew) > SKEWED_REL:
        side = "below" if skew < 0.0 else "above"
        said.append(f"the mean lies {abs(skew):.1%} {side} the median: part of it shows something else")
    text = ", and ".join(said)
    detail = (
        f"{text[0].upper()}{text[1:]}. Look at the preview: does the region still lie on the measured "
        "surface, without tape, edge or shadow? Redraw it, give this frame a region of its own, or even "
        "out the light."
    )
    return shared.UNEVEN.reason(detail, "warn")


def inspect_scenes(
    rows: Sequence[FrameRow], readings: Sequence[Reading], params: Params
) -> dict[str, list[Reason]]:
    """Check which light frames lack a scene or its reading, and in which scenes the lamp drifted."""
    read = sort_naturally({reading.scene for reading in readings if reading.quantity == "luminance"})
    scenes = summarise_scenes(readings, panel_rho=params.panel_rho)
    drifts = {
        raised.where: raised.detail for raised in check_scenes(scenes) if raised.flag == codes.LAMP_DRIFT
    }

    @cache
    def inspect(scene: str | None) -> list[Reason]:
        if not scene:
            detail = "Nobody said which light level this frame shows: give it its scene."
            return [codes.SCENE_MISSING.reason(detail)]
        reasons = [] if scene in read else [_reading_missing(scene, read)]
        if f"scene {scene}" in drifts:
            detail = (
                f"{drifts[f'scene {scene}']} The lamp drifted in scene {scene}: let it warm up, then "
                "repeat the frames and the readings of this level."
            )
            reasons.append(codes.LAMP_DRIFT.reason(detail))
        return reasons

    return {row.frame: inspect(row.scene) for row in rows if row.role == "light"}


def _reading_missing(scene: str, read: Sequence[str]) -> Reason:
    there = f"; there are readings of {name_few('', read)}" if read else ""
    detail = (
        f"No luminance reading of {name_few('scene', [scene])}{there}. Read the meter while the lamp still "
        "burns at this level, or correct the name."
    )
    return codes.READING_MISSING.reason(detail)


def find_repeats(rows: Sequence[FrameRow], params: Params) -> dict[str, list[Reason]]:
    """Find the light frames that repeat another of the same scene and settings."""
    groups: dict[tuple[str, exposure.Settings], list[str]] = {}
    for row in sorted(rows, key=lambda row: row.frame):
        if row.role == "light" and row.scene:
            groups.setdefault((row.scene, row.settings_on(params.exposure_basis)), []).append(row.frame)
    found: dict[str, list[Reason]] = {}
    for (scene, settings), (earlier, *repeats) in groups.items():
        detail = (
            f"{earlier} shows scene {scene} at {show_settings(settings)} already: a repeat "
            "shares the errors of reading and aperture and adds next to nothing. Change the aperture or "
            "the level."
        )
        reasons = [shared.REDUNDANT.reason(detail, "warn")]
        found |= dict.fromkeys(repeats, reasons)
    return found


def show_settings(settings: exposure.Settings) -> str:
    return f"ISO {settings.iso:g}, {write_exposure(settings.exposure_time_s)}, f/{settings.f_number:g}"


def show_stops(ratio: float) -> str:
    """Format a ratio of light in stops, rounded up to the thirds that a camera can set."""
    thirds = max(1, math.ceil(3.0 * math.log2(ratio) - 1e-9))
    whole, rest = divmod(thirds, 3)
    number = (f"{whole}" if whole else "") + _THIRDS[rest]
    return f"{number.strip()} {'stop' if thirds <= 3 else 'stops'}"
