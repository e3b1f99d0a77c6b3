"""Light on a level surface while a band was exposed: levelled wherever the file allows, with its budget."""

import math
import statistics
from dataclasses import replace

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader
from radiometry.frame.light import SunshineIrradiance, SunshineRecord
from radiometry.frame.multispectral import Multispectral
from radiometry.reflectance import codes
from radiometry.reflectance.clock import find_tilt, locate_sun_of
from radiometry.reflectance.gains import Gain
from radiometry.reflectance.sun import SunPosition
from radiometry.reflectance.sunshine import Choice, Sunshine, measure_sunshine
from radiometry.reflectance.tilt import (
    FURTHEST_FROM_SUN_DEG,
    LOWEST_SUN_DEG,
    Tilt,
    TiltParams,
    attitude_u_rel,
    diffuse_u_rel,
    sun_angle_deg,
)

LARGEST_TILT_DEG = 3.0
# Of a sensor that states no attitude, as a drone leans in flight; and of a sun that nobody can locate.
ASSUMED_TILT_DEG = 5.0
ASSUMED_SUN = SunPosition(elevation_deg=45.0, azimuth_deg=0.0)


def measure_light(
    header: FrameHeader,
    *,
    choice: Choice = "mean",
    params: TiltParams | None = None,
    ratio: Gain | None = None,
    where: str = "",
) -> Sunshine:
    """Compute the irradiance on a level surface at the time of a frame.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the frame.
    choice : Choice, default: "mean"
        Choice among the sunshine readings.
    params : TiltParams or None, default: None
        Assumptions of the correction; None leaves the readings as the sensor was
        oriented.
    ratio : Gain or None, default: None
        CH0 / CH1 of a Sequoia's sensor, for a saturated channel 0.
    where : str, default: ""
        What the flags name.

    Returns
    -------
    Sunshine
        Light with the uncertainty of its level. Flags: those of `measure_sunshine`,
        `tilt_not_correctable`, `sunshine_tilted`.

    Raises
    ------
    InputRejected
        `sunshine_missing`.

    Notes
    -----
    Direct and scattered light as the file states them take the place of the assumed
    diffuse fraction, d = scattered / (direct sin(elevation) + scattered). Of a
    reading that cannot be levelled, the whole tilt is in the budget, with the
    sensor's attitude taken as 5 degrees and the sun's elevation as 45 where they are
    not known.
    """
    band = header.multispectral
    if band is None:
        raise InputRejected(codes.SUNSHINE_MISSING, "The file is not a multispectral camera's.")
    assumed, sun = params or TiltParams(), locate_sun_of(header)
    if sun is not None:
        assumed = replace(assumed, diffuse_share=_find_share(band, sun, assumed))
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


def _find_share(band: Multispectral, sun: SunPosition, params: TiltParams) -> float:
    stated = band.irradiance
    if stated is None or stated.direct_w_m2_nm is None or stated.scattered_w_m2_nm is None:
        return params.diffuse_share
    direct = stated.direct_w_m2_nm * math.sin(math.radians(max(0.0, sun.elevation_deg)))
    total = direct + stated.scattered_w_m2_nm
    if min(direct, stated.scattered_w_m2_nm) < 0.0 or not total > 0.0:
        return params.diffuse_share
    return stated.scattered_w_m2_nm / total


def _add_level(
    found: Sunshine, band: Multispectral, tilt: Tilt, *, levelled: bool, reason: str, where: str
) -> Sunshine:
    readings = (
        [band.irradiance] if band.irradiance is not None else band.counts.records if band.counts else ()
    )
    attitudes = [each for each in map(_read_attitude, readings) if each is not None]
    level_deg = 90.0 - tilt.sun.elevation_deg
    angles = [
        angle
        for yaw, pitch, roll in attitudes
        if (angle := sun_angle_deg(tilt.sun, yaw_deg=yaw, pitch_deg=pitch, roll_deg=roll))
        <= FURTHEST_FROM_SUN_DEG
    ]
    own_deg, flags = tilt.params.attitude_u_deg, list(found.flags)
    if reason:
        flags.append(codes.TILT_NOT_CORRECTABLE.at(where, reason))
    if levelled:
        angle_deg = statistics.fmean(angles)
        u_rel = math.hypot(attitude_u_rel(angle_deg, tilt, u_deg=own_deg), diffuse_u_rel(angle_deg, tilt))
        return replace(found, level_u_rel=u_rel, flags=tuple(flags))
    remaining_deg = 0.0
    if band.irradiance is None or band.irradiance.quantity == "spectral":
        tilts_deg = [_tilt_deg(pitch, roll) for _, pitch, roll in attitudes]
        remaining_deg = statistics.fmean(tilts_deg) if tilts_deg else ASSUMED_TILT_DEG
        if tilts_deg and remaining_deg > LARGEST_TILT_DEG:
            flags.append(codes.SUNSHINE_TILTED.at(where, f"{remaining_deg:.1f} degrees off level."))
    u_rel = attitude_u_rel(level_deg, tilt, u_deg=math.hypot(own_deg, remaining_deg))
    return replace(found, level_u_rel=u_rel, flags=tuple(flags))


def _read_attitude(reading: SunshineRecord | SunshineIrradiance) -> tuple[float, float, float] | None:
    if reading.yaw_deg is None or reading.pitch_deg is None or reading.roll_deg is None:
        return None
    return reading.yaw_deg, reading.pitch_deg, reading.roll_deg


def _tilt_deg(pitch_deg: float, roll_deg: float) -> float:
    return math.degrees(math.acos(math.cos(math.radians(pitch_deg)) * math.cos(math.radians(roll_deg))))
