"""Readings of a sunshine sensor that counts, in either of its two channels."""

import math
import statistics
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from radiometry.findings import InputRejected
from radiometry.frame.light import SunshineCounts, SunshineIrradiance, SunshineRecord
from radiometry.frame.multispectral import Multispectral
from radiometry.reflectance import codes
from radiometry.reflectance.gains import (
    REFERENCE_INDEX,
    ROUNDING,
    Channel,
    Gain,
    has_stopped,
    measure_gains,
    measure_scales,
    name_second,
)
from radiometry.reflectance.tilt import FURTHEST_FROM_SUN_DEG, Tilt, level_factor, sun_angle_deg

# What records without the two fields are taken for: what later firmware wrote by day.
ASSUMED_INTEGRATION_TIME_S = 0.1


@dataclass(frozen=True, kw_only=True)
class SunshineReading:
    """One reading of the sunshine sensor.

    Attributes
    ----------
    time_us : int
        Time on the camera's clock [us].
    count : int
        Count of channel 0, or of channel 1 where that took its place.
    gain_index : int
        Index i of the gain; -1 - i in channel 1.
    i_ss : float or None
        Reading [counts/s at gain index 1]; None if it is not valid.
    left_out : str
        Reason why it is not valid, else "".
    oriented : float
        Reading as the sensor was oriented; 0 if it is not valid.
    """

    time_us: int
    count: int
    gain_index: int
    i_ss: float | None
    left_out: str
    oriented: float


def compare_channels(bands: Iterable[Multispectral]) -> Gain | None:
    """Compute CH0 / CH1 of one band under the light of its files, at the reference index.

    Parameters
    ----------
    bands : iterable of Multispectral
        Metadata of the band's panel frames.

    Returns
    -------
    Gain or None
        Ratio of the file that states it best; None if none counts in both channels.
    """
    found = []
    for counts in (band.counts for band in bands if band.counts is not None):
        scales = measure_gains(counts.gains) | {
            name_second(index): gain for index, gain in measure_gains(counts.gains, channel="ch1").items()
        }
        both = [
            pair
            for pair in zip(
                list_readings(counts, scales), list_readings(counts, scales, channel="ch1"), strict=True
            )
            if all(reading.i_ss is not None for reading in pair)
        ]
        if both:
            ch0, ch1 = zip(*both, strict=True)
            u = [scales[each.gain_index].u_rel for each in (*ch0, *ch1)]
            rounding = [ROUNDING / statistics.fmean(each.count for each in channel) for channel in (ch0, ch1)]
            found.append(
                Gain(
                    value=math.fsum(each.oriented for each in ch0) / math.fsum(each.oriented for each in ch1),
                    u_rel=math.hypot(max(u), *rounding),
                )
            )
    return min(found, key=lambda gain: gain.u_rel, default=None)


def list_readings(
    counts: SunshineCounts,
    scales: Mapping[int, Gain] | None = None,
    *,
    tilt: Tilt | None = None,
    channel: Channel = "ch0",
) -> tuple[SunshineReading, ...]:
    """List every reading with its I_ss, or the reason why it has none.

    Parameters
    ----------
    counts : SunshineCounts
        Irradiance list and gain table of the file.
    scales : mapping of int to Gain, optional
        Gains of `measure_scales`; None for those of the gain table.
    tilt : Tilt or None, default: None
        Tilt correction; None without it.
    channel : Channel, default: "ch0"
        Channel of the sensor.

    Returns
    -------
    tuple of SunshineReading
        Readings in the order of the list.

    Notes
    -----
    Not valid are a saturated count (65535, or 36863 in 100 ms), a count or integration
    time of zero, and a gain index without a gain.
    """
    scales = measure_scales(counts.gains) if scales is None else scales
    return tuple(_read(record, scales, tilt, channel) for record in counts.records)


def _read(
    record: SunshineRecord, scales: Mapping[int, Gain], tilt: Tilt | None, channel: Channel
) -> SunshineReading:
    index = REFERENCE_INDEX if record.gain_index is None else record.gain_index
    index, count = (index, record.ch0) if channel == "ch0" else (name_second(index), record.ch1)
    time_s = record.integration_time_s
    if time_s is None:
        time_s = ASSUMED_INTEGRATION_TIME_S
    left_out, factor = "", 1.0
    if has_stopped(count, time_s):
        left_out = "saturated count"
    elif count == 0:
        left_out = "no light"
    elif not time_s > 0.0:
        left_out = "no integration time"
    elif index not in scales:
        left_out = "unknown gain"
    elif tilt is not None:
        angle_deg = angle_to_sun(record, tilt)
        if angle_deg > FURTHEST_FROM_SUN_DEG:
            left_out = "turned away from the sun"
        else:
            factor = level_factor(angle_deg, tilt)
    oriented = 0.0 if left_out else count / (scales[index].value * time_s)
    return SunshineReading(
        time_us=record.time_us,
        count=count,
        gain_index=index,
        i_ss=None if left_out else oriented * factor,
        left_out=left_out,
        oriented=oriented,
    )


def angle_to_sun(record: SunshineRecord | SunshineIrradiance, tilt: Tilt) -> float:
    """Return the angle between a sensor's normal and the sun [deg].

    Parameters
    ----------
    record : SunshineRecord or SunshineIrradiance
        Reading with the attitude of the sensor.
    tilt : Tilt
        Position of the sun.

    Raises
    ------
    InputRejected
        `tilt_not_correctable` if the attitude is not stated.
    """
    if record.yaw_deg is None or record.pitch_deg is None or record.roll_deg is None:
        raise InputRejected(
            codes.TILT_NOT_CORRECTABLE,
            "The sunshine readings do not state how the sensor hung.",
        )
    return sun_angle_deg(
        tilt.sun, yaw_deg=record.yaw_deg, pitch_deg=record.pitch_deg, roll_deg=record.roll_deg
    )
