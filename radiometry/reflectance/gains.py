"""Relative gains of the sunshine sensor, from the table that every unit carries."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from radiometry.frame.light import GainMeasurement

REFERENCE_INDEX = 1
SATURATED_COUNT = 65_535
# The gains of a real sensor (24.6 and 16.7 between indices) are those of ams' TSL2591, whose counters stop
# here in its shortest time.
SHORT_SATURATED_COUNT, SHORT_TIME_S = 36_863, 0.1
# A table's ratio of the channels holds for its own light. Under the sun it was off by 2, 4, 5 and 95 % in the
# four bands of a real capture: the root mean square of the logarithms.
_OTHER_LIGHT_U_REL = 0.35

# The standard uncertainty of a number rounded to a whole one.
ROUNDING = 1.0 / math.sqrt(12.0)

Channel = Literal["ch0", "ch1"]


@dataclass(frozen=True, kw_only=True)
class Gain:
    """Relative gain of one index.

    Attributes
    ----------
    value : float
        Gain relative to the reference index.
    u_rel : float
        Relative standard uncertainty from the rounding of its counts.
    """

    value: float
    u_rel: float


def measure_gains(rows: Sequence[GainMeasurement], *, channel: Channel = "ch0") -> dict[int, Gain]:
    """Compute the relative gain of every usable index of a channel.

    Returns
    -------
    dict of int to Gain
        Gain by index.

    Notes
    -----
    With reference index 1 and all rows at equal light [1]_::

        g_rel(i) = (CH_i / tau_i) / (CH_ref / tau_ref)
        u_rel^2 = (1/12) / CH_i^2 + (1/12) / CH_ref^2        2.6 % for 11 counts

    The ratios belong to one unit, band and channel. An index whose count is
    saturated (65535) or zero has no gain in that channel. Without a usable
    reference row only the reference itself has one, which is 1 by definition.
    Dividing by the gain INDEX instead is a common mistake: 6 times wrong at index
    2, and index 0 divides by zero.

    References
    ----------
    .. [1] "How to convert Sequoia images to reflectance?" 1.1, section 6
    """
    gains = {REFERENCE_INDEX: Gain(value=1.0, u_rel=0.0)}
    usable = {row.gain_index: row for row in rows if _is_usable(row, channel)}
    reference = usable.get(REFERENCE_INDEX)
    if reference is None:
        return gains
    reference_count = _count(reference, channel)
    for index, row in usable.items():
        if index != REFERENCE_INDEX:
            count = _count(row, channel)
            gains[index] = Gain(
                value=(count / row.integration_time_s) / (reference_count / reference.integration_time_s),
                u_rel=math.hypot(ROUNDING / count, ROUNDING / reference_count),
            )
    return gains


def measure_scales(rows: Sequence[GainMeasurement], ratio: Gain | None = None) -> dict[int, Gain]:
    """Compute the gains by which both channels are brought to the scale of channel 0.

    Parameters
    ----------
    rows : sequence of GainMeasurement
        Gain table of the file.
    ratio : Gain or None, optional
        CH0 / CH1 at the reference index, measured under the same light; None for the
        table's own.

    Returns
    -------
    dict of int to Gain
        Gain by index i of channel 0, and by -1 - i of channel 1.
    """
    scales = measure_gains(rows)
    table = next((row for row in rows if row.gain_index == REFERENCE_INDEX), None)
    if ratio is None and table and _is_usable(table, "ch0") and _is_usable(table, "ch1"):
        ratio = Gain(
            value=table.ch0 / table.ch1,
            u_rel=math.hypot(ROUNDING / table.ch0, ROUNDING / table.ch1, _OTHER_LIGHT_U_REL),
        )
    if ratio is None:
        return scales
    return scales | {
        name_second(index): Gain(value=gain.value / ratio.value, u_rel=math.hypot(gain.u_rel, ratio.u_rel))
        for index, gain in measure_gains(rows, channel="ch1").items()
    }


def name_second(index: int) -> int:
    """Return the key of a gain index in channel 1."""
    return -1 - index


def has_stopped(count: int, time_s: float) -> bool:
    """Return True if a counter has stopped.

    Parameters
    ----------
    count : int
        Count of a channel.
    time_s : float
        Integration time [s].
    """
    return count >= SATURATED_COUNT or (count == SHORT_SATURATED_COUNT and time_s <= SHORT_TIME_S)


def _count(row: GainMeasurement, channel: Channel) -> int:
    return row.ch0 if channel == "ch0" else row.ch1


def _is_usable(row: GainMeasurement, channel: Channel) -> bool:
    return 0 < _count(row, channel) < SATURATED_COUNT and row.integration_time_s > 0.0
