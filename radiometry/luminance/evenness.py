"""Test of a region for one evenly lit surface, from its statistics beyond noise."""

import math
from collections.abc import Sequence

from radiometry.findings import Reason, shared
from radiometry.frame.statistics import ChannelStatistics
from radiometry.luminance.points import Candidate, is_below_detection, is_saturated

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


def inspect_evenness(
    candidates: Sequence[Candidate], channel: str, *, dark_std_dn: float
) -> dict[str, list[Reason]]:
    """Find the light frames of an ISO value that show more than one evenly lit surface.

    Parameters
    ----------
    candidates : sequence of Candidate
        Light frames of one ISO value.
    channel : str
        Channel of which the signal is made.
    dark_std_dn : float
        Standard deviation of the quietest dark frame [DN]; 0 if there is none.

    Returns
    -------
    dict of str to list of Reason
        `uneven` (warn) by name of the frame.

    Notes
    -----
    The model of the variance is, with S the signal above dark [1]_::

        std^2 = std_dark^2 + g S + (u S)^2

    Photon noise g S, with a gain g that no file states, and unevenness u S both add
    to the dark frames' std. For every frame (std^2 - std_dark^2) / S is g or more,
    so the least of the series is a gain that is never too small, and::

        u^2 >= ((std^2 - std_dark^2) / S - g) / S

    This is a lower bound of the unevenness: it shows most of it if the series also
    contains weak signals, and nothing in a single frame. In addition, the mean and
    median of a surface agree to noise, to rounding, and to the skewness of photon
    noise, g / 6 <= std^2 / (6 S); if they do not, part of the region is something
    else.

    References
    ----------
    .. [1] EMVA Standard 1288, release 4.0, 2021, equation for temporal and spatial
           variance
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
    if is_saturated(candidate.signal) or is_below_detection(candidate.signal, candidate.dark):
        return None
    rows, adjusted = candidate.select_rows(channel), candidate.above_dark_dn
    per_dn, error = _measure_spread(rows, adjusted, dark_std_dn)
    skew = None
    if adjusted >= JUDGED_SHARE * candidate.span_dn:
        skew = max((_measure_skew(row, adjusted) for row in rows), key=abs)
    return per_dn - _ERRORS * error, per_dn + _ERRORS * error, adjusted, skew


def _measure_spread(
    rows: Sequence[ChannelStatistics], adjusted_dn: float, dark_std_dn: float
) -> tuple[float, float]:
    """Compute (std^2 - std_dark^2) / S and its standard error [DN]: var(std^2) = 2 std^4 / n."""
    variance = math.fsum(row.std_dn**2 for row in rows) / len(rows)
    error = variance * math.sqrt(2.0 / sum(row.n for row in rows))
    return (variance - dark_std_dn**2) / adjusted_dn, error / adjusted_dn


def _measure_skew(row: ChannelStatistics, adjusted_dn: float) -> float:
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
