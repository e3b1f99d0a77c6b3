"""Light on the scene while a band was exposed, as its sunshine sensor measured it, and on a level surface."""

import itertools
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Literal

from radiometry.findings import InputRejected, Raised
from radiometry.frame import FrameHeader, multispectral
from radiometry.frame.multispectral import GainMeasurement, Multispectral, SunshineIrradiance, SunshineRecord
from radiometry.records import Record
from radiometry.reflectance import codes
from radiometry.reflectance.sun import (
    FURTHEST_FROM_SUN_DEG,
    LOWEST_SUN_DEG,
    UNSHARED,
    Angles,
    SunPosition,
    Tilt,
    TiltParams,
    attitude_u_rel,
    find_tilt,
    level_attitudes,
    list_level_effects,
    locate_suns_of,
    share_at,
    share_u_at,
    sun_angle_deg,
    turned_deg,
)

Channel = Literal["ch0", "ch1"]
Choice = Literal["mean", "last", "nearest"]

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
# What records without the two fields are taken for: what later firmware wrote by day.
ASSUMED_INTEGRATION_TIME_S = 0.1
COUNTS_UNIT = "1/s"
# Of a file's only reading: between a Sequoia at rest (0.2 %) and the bands of a RedEdge (4.7 %).
SINGLE_READING_U_REL = 0.025
_BASES: dict[str, multispectral.LightBasis] = {
    "spectral": "oriented",
    "horizontal": "horizontal",
    "compensated": "compensated",
}
_GENERATIONS = {"dls1": "W/m2/nm", "dls2": "uW/cm2/nm"}
LARGEST_TILT_DEG = 3.0
# A P4 repeats its readings within 0.12 %, one of five bands bit for bit. A sensor that turns by little sees
# nearly the same light by chance.
_REPEATS_REL, _LEANS_DEG = 0.002, 10.0
# Of a sensor that states no attitude, as a drone leans in flight; and of a sun that nobody can locate.
ASSUMED_TILT_DEG = 5.0
ASSUMED_SUN = SunPosition(elevation_deg=45.0, azimuth_deg=0.0)


class Gain(Record):
    """Relative gain of one index."""

    value: float
    u_rel: float  # from the rounding of its counts


def measure_gains(rows: Sequence[GainMeasurement], *, channel: Channel = "ch0") -> dict[int, Gain]:
    """Compute the relative gain of every usable index of a channel.

    With reference index 1 and all rows at equal light [1]::

        g_rel(i) = (CH_i / tau_i) / (CH_ref / tau_ref)
        u_rel^2 = (1/12) / CH_i^2 + (1/12) / CH_ref^2        2.6 % for 11 counts

    The ratios belong to one unit, band and channel. An index whose count is saturated (65535) or zero has no
    gain in that channel. Without a usable reference row only the reference itself has one, which is 1 by
    definition. Dividing by the gain INDEX instead is a common mistake: 6 times wrong at index 2, and index 0
    divides by zero.

    [1] "How to convert Sequoia images to reflectance?" 1.1, section 6
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
    """Compute the gains by which both channels are brought to the scale of channel 0."""
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


def _count(row: GainMeasurement, channel: Channel) -> int:
    return row.ch0 if channel == "ch0" else row.ch1


def _is_usable(row: GainMeasurement, channel: Channel) -> bool:
    return 0 < _count(row, channel) < SATURATED_COUNT and row.integration_time_s > 0.0


class SunshineReading(Record):
    """One reading of the sunshine sensor."""

    time_us: int  # on the camera's clock
    count: int  # of channel 0, or of channel 1 where that took its place
    gain_index: int  # index i of the gain; -1 - i in channel 1
    i_ss: float | None  # counts/s at gain index 1; None if it is not valid
    left_out: str  # reason why it is not valid, else ""
    oriented: float  # as the sensor was oriented; 0 if it is not valid


def compare_channels(bands: Iterable[Multispectral]) -> Gain | None:
    """Compute CH0 / CH1 of one band under the light of its files, at the reference index."""
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
    counts: multispectral.SunshineCounts,
    scales: Mapping[int, Gain] | None = None,
    *,
    tilt: Tilt | None = None,
    channel: Channel = "ch0",
) -> tuple[SunshineReading, ...]:
    """List every reading with its I_ss, or the reason why it has none.

    Not valid are a saturated count (65535, or 36863 in 100 ms), a count or integration time of zero, and a
    gain index without a gain.
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
    if count >= SATURATED_COUNT or (count == SHORT_SATURATED_COUNT and time_s <= SHORT_TIME_S):
        left_out = "saturated count"
    elif count == 0:
        left_out = "no light"
    elif not time_s > 0.0:
        left_out = "no integration time"
    elif index not in scales:
        left_out = "unknown gain"
    elif tilt is not None:
        factor = _find_factor(record, tilt)
        if not factor:
            left_out = "turned away from the sun"
    oriented = 0.0 if left_out else count / (scales[index].value * time_s)
    return SunshineReading(
        time_us=record.time_us,
        count=count,
        gain_index=index,
        i_ss=None if left_out else oriented * factor,
        left_out=left_out,
        oriented=oriented,
    )


def _find_factor(record: SunshineRecord | SunshineIrradiance, tilt: Tilt) -> float:
    """Return the factor of a sensor's attitude; 0 if it was turned away from the sun."""
    attitude = _read_attitude(record)
    if attitude is None:
        raise codes.TILT_NOT_CORRECTABLE.reject("The sunshine readings do not state how the sensor hung.")
    if _angle_to_sun(attitude, tilt.sun) > FURTHEST_FROM_SUN_DEG:
        return 0.0
    return math.exp(statistics.fmean(level_attitudes([attitude], tilt)))


def _angle_to_sun(attitude: Angles, sun: SunPosition) -> float:
    yaw, pitch, roll = attitude
    return sun_angle_deg(sun, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll)


class Light(Record):
    """Reading of a light sensor as it was oriented."""

    value: float
    yaw_deg: float
    pitch_deg: float
    roll_deg: float

    @property
    def angles_deg(self) -> Angles:
        return self.yaw_deg, self.pitch_deg, self.roll_deg


def see_light(band: Multispectral) -> Light | None:
    """Return the one reading of a light sensor that hangs as the file states."""
    reading = band.irradiance
    if reading is None or reading.quantity != "spectral" or (angles := _read_attitude(reading)) is None:
        return None
    return Light(value=reading.value, yaw_deg=angles[0], pitch_deg=angles[1], roll_deg=angles[2])


def find_repeated(band: Multispectral, earlier: Iterable[Light]) -> tuple[Light, str] | None:
    """Return the earlier reading that a frame's repeats although its sensor leans otherwise, and how much."""
    now = see_light(band)
    if now is None:
        return None
    for light in earlier:
        turned = turned_deg(now.angles_deg, light.angles_deg)
        change_rel = now.value / light.value - 1.0 if light.value else 1.0
        if turned > (_LEANS_DEG if change_rel else LARGEST_TILT_DEG) and abs(change_rel) < _REPEATS_REL:
            return light, f"Changed by {change_rel:+.2%} while the sensor turned by {turned:.1f} degrees."
    return None


def recall_attitude(header: FrameHeader, panel: Sequence[Light]) -> tuple[FrameHeader, str]:
    """Return a frame's header with the attitude that its reading belongs to, and why if it is the panel's."""
    band = header.multispectral
    repeated = find_repeated(band, panel) if band is not None else None
    if band is None or band.irradiance is None or repeated is None:
        return header, ""
    light, detail = repeated
    then = replace(band.irradiance, yaw_deg=light.yaw_deg, pitch_deg=light.pitch_deg, roll_deg=light.roll_deg)
    return replace(header, multispectral=replace(band, irradiance=then)), detail


class Sunshine(Record):
    """I_ss of one band of one capture."""

    i_ss: float
    standard_uncertainty: float  # from scatter and counting in whole numbers, not from gain and attitude
    gain_u_rel: float  # cancels between captures at the same `gain_indices`
    gain_indices: tuple[int, ...]  # of the readings used; -1 - i for index i of channel 1
    unit: str
    choice: Choice
    readings: int  # number of valid ones
    left_out: tuple[str, ...]  # reasons of those that are not valid
    spread_rel: float | None  # standard deviation of the valid ones; None for a single one
    flags: tuple[Raised, ...]
    oriented: float  # as the sensor was oriented
    basis: multispectral.LightBasis = "oriented"  # surface for which `i_ss` holds
    level_u_rel: float = 0.0  # from the sensor's attitude and the diffuse fraction
    level_effects: tuple[float, ...] = ()  # those of its parts that captures share (`list_level_effects`)

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

    With tau the sunshine sensor's own integration time, not the image's exposure [1]::

        I_ss = CH0 / (g_rel tau)

    Where no CH0 is valid, CH1 times the ratio of the channels takes its place. A mean of n has, with s_c the
    noise in counts::

        u^2 = s^2/n + (1/12) exp(-4 pi^2 s_c^2)          s = 2.5 % of a single reading

    Rounding to whole counts does not average out unless noise carries the counts across the steps, and a band
    may count 5.

    [1] "How to convert Sequoia images to reflectance?" 1.1, section 4b
    """
    if band.irradiance is not None:
        return _take_irradiance(band.irradiance, choice=choice, tilt=tilt, where=where)
    if band.counts is None:
        raise codes.SUNSHINE_MISSING.reject(
            _advise(f"There is no sunshine reading: {band.sunshine_missing}.")
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
        raise codes.SUNSHINE_MISSING.reject(
            _advise(f"None of {len(readings)} sunshine readings is valid: {reasons}.")
        )
    chosen = valid
    if choice != "mean":
        at_us, chosen = band.exposed_at_us, valid[-1:]
        if choice == "nearest" and at_us is not None:
            chosen = [min(valid, key=lambda reading: abs(reading.time_us - at_us))]
        elif choice == "nearest":
            flags.append(codes.SUNSHINE_TIME_UNKNOWN.at(where, "No exposure time."))
    if len(valid) == 1:
        flags.append(codes.SUNSHINE_SINGLE_READING.at(where, "Readings: 1."))
    found = _summarise(valid, chosen, scales, choice=choice, left_out=left_out, flags=tuple(flags))
    return replace(found, basis="oriented" if tilt is None else "levelled")


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


def _flag_counts(
    counts: multispectral.SunshineCounts, left_out: tuple[str, ...], total: int, where: str
) -> list[Raised]:
    raised = []
    if left_out:
        detail = f"{len(left_out)} of {total}: {', '.join(sorted(set(left_out)))}."
        raised.append(codes.SUNSHINE_READINGS_LEFT_OUT.at(where, detail))
    if any(record.gain_index is None for record in counts.records):
        raised.append(codes.SUNSHINE_GAIN_ASSUMED.at(where, f"Records of {counts.record_bytes} bytes."))
    elif len(measure_gains(counts.gains)) == 1:
        raised.append(codes.SUNSHINE_GAIN_TABLE_MISSING.at(where, f"Rows in the table: {len(counts.gains)}."))
    return raised


def _take_irradiance(
    reading: SunshineIrradiance, *, choice: Choice, tilt: Tilt | None, where: str
) -> Sunshine:
    """Use a light sensor's one reading; one that the camera levelled is not levelled again."""
    factor, basis = 1.0, _BASES[reading.quantity]
    if tilt is not None and basis == "oriented":
        factor, basis = _find_factor(reading, tilt), "levelled"
        if not factor:
            raise codes.SUNSHINE_MISSING.reject(_advise("The only reading was turned away from the sun."))
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


def measure_light(
    header: FrameHeader,
    *,
    choice: Choice = "mean",
    params: TiltParams | None = None,
    ratio: Gain | None = None,
    where: str = "",
) -> Sunshine:
    """Compute the irradiance on a level surface at the time of a frame.

    Direct and scattered light as the file states them take the place of the assumed diffuse fraction, d =
    scattered / (direct sin(elevation) + scattered). Of a reading that cannot be levelled, the whole tilt is
    in the budget, with the sensor's attitude taken as 5 degrees and the sun's elevation as 45 where they are
    not known.
    """
    band = header.multispectral
    if band is None:
        raise codes.SUNSHINE_MISSING.reject("The file is not a multispectral camera's.")
    assumed, suns = params or TiltParams(), locate_suns_of(header)
    sun = suns[len(suns) // 2] if suns else None
    if sun is not None:
        assumed = _adapt_share(band, sun, assumed)
    levelled, reason = None, ""
    if params is not None and not (band.irradiance is not None and band.irradiance.quantity != "spectral"):
        try:
            levelled = find_tilt(header, assumed)
            found = measure_sunshine(band, choice=choice, tilt=levelled, ratio=ratio, where=where)
        except InputRejected as rejected:
            if rejected.code != codes.TILT_NOT_CORRECTABLE:
                raise
            levelled, reason = None, rejected.message
    if levelled is None:
        found = measure_sunshine(band, choice=choice, ratio=ratio, where=where)
    # of a lower sun the assumed share of direct light no longer holds
    sun = replace(sun, elevation_deg=max(sun.elevation_deg, LOWEST_SUN_DEG)) if sun else ASSUMED_SUN
    tilt = levelled or Tilt(sun=sun, params=assumed)
    return _add_level(found, band, tilt, levelled=levelled is not None, reason=reason, where=where)


def _adapt_share(band: Multispectral, sun: SunPosition, params: TiltParams) -> TiltParams:
    """Return the diffuse fraction that a band's file states, else the one at its wavelength."""
    stated = band.irradiance
    assumed = replace(
        params,
        diffuse_share=share_at(params.diffuse_share, band.wavelength_nm),
        diffuse_share_u=share_u_at(params, band.wavelength_nm),
    )
    if stated is None or stated.direct_w_m2_nm is None or stated.scattered_w_m2_nm is None:
        return assumed
    direct = stated.direct_w_m2_nm * math.sin(math.radians(max(0.0, sun.elevation_deg)))
    total = direct + stated.scattered_w_m2_nm
    if min(direct, stated.scattered_w_m2_nm) < 0.0 or not total > 0.0:
        return assumed
    return replace(params, diffuse_share=stated.scattered_w_m2_nm / total)


def _add_level(
    found: Sunshine, band: Multispectral, tilt: Tilt, *, levelled: bool, reason: str, where: str
) -> Sunshine:
    readings = (
        [band.irradiance] if band.irradiance is not None else band.counts.records if band.counts else ()
    )
    attitudes = [each for each in map(_read_attitude, readings) if each is not None]
    level_deg = 90.0 - tilt.sun.elevation_deg
    own_deg, flags = tilt.params.attitude_u_deg, list(found.flags)
    if reason:
        flags.append(codes.TILT_NOT_CORRECTABLE.at(where, reason))
    if levelled:
        lit = [each for each in attitudes if _angle_to_sun(each, tilt.sun) <= FURTHEST_FROM_SUN_DEG]
        angle_deg = statistics.fmean(_angle_to_sun(each, tilt.sun) for each in lit)
        effects = list_level_effects(lit, tilt)
        u_rel = math.hypot(attitude_u_rel(angle_deg, tilt, u_deg=UNSHARED * own_deg), *effects)
        if tilt.by_zone:
            flags.append(codes.ZONE_UNKNOWN.at(where, f"{math.hypot(*effects[:-3]):.1%} of the irradiance."))
        return replace(found, level_u_rel=u_rel, level_effects=effects, flags=tuple(flags))
    remaining_deg = 0.0
    if band.irradiance is None or band.irradiance.quantity == "spectral":
        tilts_deg = [
            math.degrees(math.acos(math.cos(math.radians(pitch)) * math.cos(math.radians(roll))))
            for _, pitch, roll in attitudes
        ]
        remaining_deg = statistics.fmean(tilts_deg) if tilts_deg else ASSUMED_TILT_DEG
        if tilts_deg and remaining_deg > LARGEST_TILT_DEG:
            flags.append(codes.SUNSHINE_TILTED.at(where, f"{remaining_deg:.1f} degrees off level."))
    u_rel = attitude_u_rel(level_deg, tilt, u_deg=math.hypot(own_deg, remaining_deg))
    return replace(found, level_u_rel=u_rel, flags=tuple(flags))


def _read_attitude(reading: SunshineRecord | SunshineIrradiance) -> Angles | None:
    if reading.yaw_deg is None or reading.pitch_deg is None or reading.roll_deg is None:
        return None
    return reading.yaw_deg, reading.pitch_deg, reading.roll_deg
