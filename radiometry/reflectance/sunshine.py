"""Light on the scene while a band was exposed, as measured by the sunshine sensor."""

import itertools
import math
import statistics
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from radiometry.findings import InputRejected, Raised
from radiometry.frame.light import LightBasis, SunshineCounts, SunshineIrradiance
from radiometry.frame.multispectral import Multispectral
from radiometry.reflectance import codes
from radiometry.reflectance.gains import ROUNDING, Gain, measure_gains, measure_scales
from radiometry.reflectance.sunshine_counts import SunshineReading, angle_to_sun, list_readings
from radiometry.reflectance.tilt import FURTHEST_FROM_SUN_DEG, Tilt, level_factor

Choice = Literal["mean", "last", "nearest"]

COUNTS_UNIT = "1/s"
# Of a file's only reading: between a Sequoia at rest (0.2 %) and the bands of a RedEdge (4.7 %).
SINGLE_READING_U_REL = 0.025
_BASES: dict[str, LightBasis] = {
    "spectral": "oriented",
    "horizontal": "horizontal",
    "compensated": "compensated",
}
_GENERATIONS = {"dls1": "W/m2/nm", "dls2": "uW/cm2/nm"}


@dataclass(frozen=True, kw_only=True)
class Sunshine:
    """I_ss of one band of one capture.

    Attributes
    ----------
    i_ss : float
        Sunshine reading, in `unit`.
    standard_uncertainty : float
        From the readings' scatter, 2.5 % of a single one, and from counting in whole
        numbers; not from the gain, and not from the attitude.
    gain_u_rel : float
        Relative standard uncertainty of the relative gain; it cancels between
        captures at the same `gain_indices`.
    gain_indices : tuple of int
        Gain indices of the readings used; -1 - i for index i of channel 1.
    unit : str
        Unit of the reading.
    choice : Choice
        Choice among the readings.
    readings : int
        Number of valid readings.
    left_out : tuple of str
        Reasons of the readings that are not valid.
    spread_rel : float or None
        Standard deviation of the valid readings, relative to their mean; None for a
        single one.
    flags : tuple of Raised
        Flags of the readings.
    oriented : float
        Reading as the sensor was oriented, in `unit`.
    basis : LightBasis, default: "oriented"
        Surface for which `i_ss` holds.
    level_u_rel : float, default: 0.0
        Relative standard uncertainty from the sensor's attitude and the diffuse
        fraction.
    """

    i_ss: float
    standard_uncertainty: float
    gain_u_rel: float
    gain_indices: tuple[int, ...]
    unit: str
    choice: Choice
    readings: int
    left_out: tuple[str, ...]
    spread_rel: float | None
    flags: tuple[Raised, ...]
    oriented: float
    basis: LightBasis = "oriented"
    level_u_rel: float = 0.0

    @property
    def is_single(self) -> bool:
        """Return True of one reading, whose scatter it does not show."""
        return self.spread_rel is None


def measure_sunshine(
    band: Multispectral,
    *,
    choice: Choice = "mean",
    tilt: Tilt | None = None,
    ratio: Gain | None = None,
    where: str = "",
) -> Sunshine:
    """Compute I_ss from a file's own readings.

    Parameters
    ----------
    band : Multispectral
        Metadata of the band.
    choice : Choice, default: "mean"
        Mean of the valid readings, the last, or the one nearest in time to the
        exposure.
    tilt : Tilt or None, default: None
        Corrects each reading to a level sensor by its own attitude; None leaves it
        as the sensor was oriented.
    ratio : Gain or None, default: None
        CH0 / CH1 under the light of the panel (`compare_channels`); None for that of the
        gain table.
    where : str, default: ""
        What the flags name.

    Returns
    -------
    Sunshine
        I_ss. Flags: `sunshine_readings_left_out`, `sunshine_second_channel`, `sunshine_gain_assumed`,
        `sunshine_gain_table_missing`, `sunshine_single_reading`,
        `sunshine_time_unknown`, `sunshine_scale_assumed`.

    Raises
    ------
    InputRejected
        `sunshine_missing` if there is no valid reading; `tilt_not_correctable` if
        readings have no attitude.

    Notes
    -----
    With tau the sunshine sensor's own integration time, not the image's exposure
    [1]_::

        I_ss = CH0 / (g_rel tau)

    Where no CH0 is valid, CH1 times the ratio of the channels takes its place. A mean of
    n has, with s_c the noise in counts::

        u^2 = s^2/n + (1/12) exp(-4 pi^2 s_c^2)          s = 2.5 % of a single reading

    Rounding to whole counts does not average out unless noise carries the counts
    across the steps, and a band may count 5.

    References
    ----------
    .. [1] "How to convert Sequoia images to reflectance?" 1.1, section 4b
    """
    if band.irradiance is not None:
        return _take_irradiance(band.irradiance, choice=choice, tilt=tilt, where=where)
    if band.counts is None:
        raise InputRejected(
            codes.SUNSHINE_MISSING, _advise(f"There is no sunshine reading: {band.sunshine_missing}.")
        )
    scales = measure_scales(band.counts.gains, ratio)
    readings = list_readings(band.counts, scales, tilt=tilt)
    left_out = tuple(reading.left_out for reading in readings if reading.i_ss is None)
    flags = _flag_counts(band.counts, left_out, len(readings), where)
    if len(left_out) == len(readings):
        readings = list_readings(band.counts, scales, tilt=tilt, channel="ch1")
        origin = "the gain table" if ratio is None else "the panel frames"
        detail = f"CH0: {', '.join(sorted(set(left_out)))}. The ratio of the channels is that of {origin}."
        flags.append(codes.SUNSHINE_SECOND_CHANNEL.at(where, detail))
    valid = [reading for reading in readings if reading.i_ss is not None]
    if not valid:
        reasons = ", ".join(sorted(set(left_out))) or "the list is empty"
        raise InputRejected(
            codes.SUNSHINE_MISSING, _advise(f"None of {len(readings)} sunshine readings is valid: {reasons}.")
        )
    chosen = valid
    if choice != "mean":
        chosen = [valid[-1] if choice == "last" else _find_nearest(valid, band.exposed_at_us)]
        if choice == "nearest" and band.exposed_at_us is None:
            flags.append(codes.SUNSHINE_TIME_UNKNOWN.at(where, "No exposure time."))
    if len(valid) == 1:
        flags.append(codes.SUNSHINE_SINGLE_READING.at(where, "Readings: 1."))
    found = _summarise(valid, chosen, scales, choice=choice, left_out=left_out, flags=tuple(flags))
    return replace(found, basis="oriented" if tilt is None else "levelled")


def _find_nearest(valid: Sequence[SunshineReading], exposed_at_us: int | None) -> SunshineReading:
    if exposed_at_us is None:
        return valid[-1]
    return min(valid, key=lambda reading: abs(reading.time_us - exposed_at_us))


def _summarise(
    valid: Sequence[SunshineReading],
    chosen: Sequence[SunshineReading],
    gains: dict[int, Gain],
    *,
    choice: Choice,
    left_out: tuple[str, ...],
    flags: tuple[Raised, ...],
) -> Sunshine:
    values = [reading.i_ss for reading in valid if reading.i_ss is not None]
    mean = statistics.fmean(reading.i_ss for reading in chosen if reading.i_ss is not None)
    spread_rel = statistics.stdev(values) / statistics.fmean(values) if len(values) > 1 else None
    scatter_rel = SINGLE_READING_U_REL if spread_rel is None else spread_rel / math.sqrt(len(chosen))
    return Sunshine(
        i_ss=mean,
        standard_uncertainty=mean * math.hypot(scatter_rel, _rounding_rel(chosen)),
        gain_u_rel=max(gains[reading.gain_index].u_rel for reading in chosen),
        gain_indices=tuple(sorted({reading.gain_index for reading in chosen})),
        unit=COUNTS_UNIT,
        choice=choice,
        readings=len(valid),
        left_out=left_out,
        spread_rel=spread_rel,
        flags=flags,
        oriented=statistics.fmean(reading.oriented for reading in chosen),
    )


def _rounding_rel(chosen: Sequence[SunshineReading]) -> float:
    """Return the relative error of whole counts that remains in the mean, per gain."""
    ordered = sorted(chosen, key=lambda reading: reading.gain_index)
    variance = 0.0
    for _, group in itertools.groupby(ordered, key=lambda reading: reading.gain_index):
        counts = [reading.count for reading in group]
        noise_variance = max(0.0, statistics.variance(counts) - 1 / 12) if len(counts) > 1 else 0.0
        kept = math.exp(-4.0 * math.pi**2 * noise_variance) * (ROUNDING / statistics.fmean(counts)) ** 2
        variance += kept * (len(counts) / len(chosen)) ** 2
    return math.sqrt(variance)


def _flag_counts(counts: SunshineCounts, left_out: tuple[str, ...], total: int, where: str) -> list[Raised]:
    raised = []
    if left_out:
        detail = f"{len(left_out)} of {total}: {', '.join(sorted(set(left_out)))}."
        raised.append(codes.SUNSHINE_READINGS_LEFT_OUT.at(where, detail))
    if any(record.gain_index is None for record in counts.records):
        detail = f"Records of {counts.record_bytes} bytes."
        raised.append(codes.SUNSHINE_GAIN_ASSUMED.at(where, detail))
    elif len(measure_gains(counts.gains)) == 1:
        detail = f"Rows in the table: {len(counts.gains)}."
        raised.append(codes.SUNSHINE_GAIN_TABLE_MISSING.at(where, detail))
    return raised


def _take_irradiance(
    reading: SunshineIrradiance, *, choice: Choice, tilt: Tilt | None, where: str
) -> Sunshine:
    """Use a light sensor's one reading; one that the camera levelled is not levelled again."""
    factor, basis = 1.0, _BASES[reading.quantity]
    if tilt is not None and basis == "oriented":
        angle_deg = angle_to_sun(reading, tilt)
        if angle_deg > FURTHEST_FROM_SUN_DEG:
            raise InputRejected(
                codes.SUNSHINE_MISSING, _advise("The only reading was turned away from the sun.")
            )
        factor, basis = level_factor(angle_deg, tilt), "levelled"
    flags = [codes.SUNSHINE_SINGLE_READING.at(where, "Readings: 1.")]
    if reading.unit_origin in _GENERATIONS:
        detail = f"Taken for {_GENERATIONS[reading.unit_origin]} by its generation, {reading.unit_origin}."
        flags.append(codes.SUNSHINE_SCALE_ASSUMED.at(where, detail))
    if reading.distrust:
        flags.append(codes.HORIZONTAL_IRRADIANCE_LEFT_OUT.at(where, f"{reading.distrust}."))
    return Sunshine(
        i_ss=reading.value * factor,
        standard_uncertainty=SINGLE_READING_U_REL * reading.value * factor,
        gain_u_rel=0.0,
        gain_indices=(),
        unit=reading.unit,
        choice=choice,
        readings=1,
        left_out=(reading.distrust,) if reading.distrust else (),
        spread_rel=None,
        flags=tuple(flags),
        basis=basis,
        oriented=reading.value
        if reading.quantity != "horizontal"
        else reading.spectral_w_m2_nm or reading.value,
    )


def _advise(what: str) -> str:
    return (
        f"{what} Without it a reflectance holds only for the panel's own light: fit with normalisation "
        "panel_only, or take the frame again with the sunshine sensor connected."
    )
