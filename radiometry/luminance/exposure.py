"""Exposure of a light frame: not clipped, not nearly clipped, and bright enough to contribute."""

from collections.abc import Sequence
from statistics import NormalDist

from radiometry.findings import Reason, shared
from radiometry.frame.statistics import ChannelStatistics
from radiometry.luminance import codes
from radiometry.luminance.messages import show_stops
from radiometry.luminance.points import (
    MOST_SATURATED_SHARE,
    Candidate,
    is_below_detection,
    is_saturated,
    signal_error_dn,
)

NEAR_WHITE_SHARE = 0.95
"""Of the span from dark to white. The last 5 % are where sensors bend first, and a lamp that rises by as
much would clip the next frame."""

AIM_SHARE = 0.80
"""Where the highlights should come to lie: a quarter of a stop below `NEAR_WHITE_SHARE`, which is what a
camera that moves in thirds of a stop can hit."""

USEFUL_SHARE = 0.01
"""Of the span. Black levels wander between frames by about a ten-thousandth of it (0.4 DN of 12 bits), which
is 1 % of such a signal and more of a weaker one."""

USEFUL_ERRORS = 50.0
"""Standard errors above dark: one is then 2 % of the signal, half of the tolerance of 4 %."""

_UNKNOWN_EXCESS = 4.0
"""Told of a region of which most is clipped: two stops, after which the next frame shows how many more."""

_HIGHLIGHT_SIGMAS = NormalDist().inv_cdf(1.0 - MOST_SATURATED_SHARE)

_LESS = "a shorter time, a smaller aperture (larger f-number) or a lower ISO"
_MORE = "a longer time, a larger aperture (smaller f-number) or a brighter level"


def inspect_exposure(candidate: Candidate, channel: str, *, expected_signal_dn: float | None) -> list[Reason]:
    """Check whether a light frame has too much or too little light, and by how many stops.

    Parameters
    ----------
    candidate : Candidate
        Light frame.
    channel : str
        Channel of which the signal is made.
    expected_signal_dn : float or None
        Signal above dark predicted from other frames of the scene [DN]; None if
        there is none.

    Returns
    -------
    list of Reason
        Fail, and the fit leaves the frame out: `clipped`, `too_dark`. Warn:
        `nearly_clipped`, `weak_signal`.

    Notes
    -----
    The highlights are where a normal distribution has 0.1 % above it, mean + 3.09
    std, and never above the largest sample. For a clipped region they are where a
    distribution with its median and its clipped fraction has 0.1 % above it.
    """
    given = channel, expected_signal_dn
    return candidate.keep("exposure", given, _inspect, candidate, *given)


def _inspect(candidate: Candidate, channel: str, expected_signal_dn: float | None) -> list[Reason]:
    dark, span, rows = candidate.dark, candidate.span_dn, candidate.select_rows(channel)
    if is_saturated(candidate.signal):
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
    error = signal_error_dn(candidate.signal, candidate.dark)
    useful = max(USEFUL_SHARE * candidate.span_dn, USEFUL_ERRORS * error)
    if is_below_detection(candidate.signal, candidate.dark):
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
    candidate: Candidate, rows: Sequence[ChannelStatistics], expected_signal_dn: float | None
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
        f"{MOST_SATURATED_SHARE:.1%}: the fit leaves it out. Give it {amount} less light: {_LESS}."
    )
    return shared.CLIPPED.reason(detail)


def _estimate_highlights(row: ChannelStatistics) -> float:
    """Estimate the level that 0.1 % of the samples would exceed if nothing had clipped them [DN]."""
    if row.saturated_share <= 0.0:
        return row.mean_dn + _HIGHLIGHT_SIGMAS * row.std_dn
    clipped_at = NormalDist().inv_cdf(1.0 - row.saturated_share)
    sigma = (row.white_level_dn - row.median_dn) / clipped_at
    return row.median_dn + _HIGHLIGHT_SIGMAS * max(sigma, 0.0)
