"""Position of the sun over a frame, and the irradiance on a level surface from a tilted sensor."""

import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader, has_set_clock, writes_utc
from radiometry.reflectance import codes
from radiometry.specification.parameters import check_parameters, parameter

LOWEST_SUN_DEG = 10.0
FURTHEST_FROM_SUN_DEG = 80.0


@dataclass(frozen=True, kw_only=True)
class SunPosition:
    """Direction of the sun."""

    elevation_deg: float  # above the horizon, without refraction
    azimuth_deg: float  # from north over east


def locate_sun(at: datetime, *, latitude_deg: float, longitude_deg: float) -> SunPosition:
    """Compute the sun's direction at a place and time.

    The Astronomical Almanac's low-precision formulae [1] are within 0.012 degrees of NREL's SPA from 2000 to
    2050 (2,000 places and times), apart from refraction (0.03 degrees at 30 degrees of elevation, 0.09 at
    10), which is left out.

    [1] J. J. Michalsky, Solar Energy 40 (3), 227 (1988), doi:10.1016/0038-092X(88)90045-X
    """
    days = (at - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds() / 86400.0
    mean_longitude_deg = (280.460 + 0.9856474 * days) % 360.0
    anomaly = math.radians((357.528 + 0.9856003 * days) % 360.0)
    ecliptic = math.radians(mean_longitude_deg + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2.0 * anomaly))
    obliquity = math.radians(23.439 - 0.0000004 * days)
    right_ascension = math.atan2(math.cos(obliquity) * math.sin(ecliptic), math.cos(ecliptic))
    declination = math.asin(math.sin(obliquity) * math.sin(ecliptic))
    sidereal_deg = (280.46062 + 360.98564737 * days) % 360.0
    hour_angle = math.radians(sidereal_deg + longitude_deg) - right_ascension
    latitude = math.radians(latitude_deg)
    elevation = math.asin(
        math.sin(declination) * math.sin(latitude)
        + math.cos(declination) * math.cos(latitude) * math.cos(hour_angle)
    )
    azimuth = math.atan2(
        -math.cos(declination) * math.sin(hour_angle),
        math.sin(declination) * math.cos(latitude)
        - math.cos(declination) * math.sin(latitude) * math.cos(hour_angle),
    )
    return SunPosition(elevation_deg=math.degrees(elevation), azimuth_deg=math.degrees(azimuth) % 360.0)


@dataclass(frozen=True, kw_only=True)
class TiltParams:
    """Assumptions about sky and sensor of the tilt correction."""

    diffuse_share: float = parameter(
        1.0 / 6.0,
        label="Diffuse fraction",
        description="Diffuse fraction of the horizontal irradiance, 1/6 under a clear sky.",
        bounds="[0, 1]",
    )
    refractive_index: float = parameter(
        1.38,
        label="Refractive index",
        description="Refractive index of the sensor's diffuser, 1.38 for PTFE.",
        bounds="[1, 3]",
    )
    diffuse_share_u: float = parameter(
        0.1,
        label="Uncertainty of the diffuse fraction",
        description="Its standard uncertainty; a fraction that the file states has the same.",
        bounds="[0, 1]",
    )
    attitude_u_deg: float = parameter(
        2.0,
        label="Uncertainty of the attitude",
        description="Standard uncertainty of the sensor's attitude towards the sun.",
        unit="deg",
        bounds="[0, 45]",
    )

    def __post_init__(self) -> None:
        check_parameters(self)


@dataclass(frozen=True, kw_only=True)
class Tilt:
    """Position of the sun at the time of a capture, and the assumptions of the correction."""

    sun: SunPosition
    params: TiltParams


def require_high_sun(sun: SunPosition) -> None:
    """Refuse a sun under 10 degrees: there the correction is mostly the attitude's error."""
    if sun.elevation_deg < LOWEST_SUN_DEG:
        raise InputRejected(
            codes.TILT_NOT_CORRECTABLE,
            f"The sun stands at {sun.elevation_deg:.1f} degrees: under {LOWEST_SUN_DEG:g} the tilt of the "
            "sunshine sensor cannot be corrected. Fly when it is higher.",
        )


def transmit(angle_deg: float, *, refractive_index: float) -> float:
    """Compute the fraction of unpolarised light that enters a diffuser at an angle.

    T = 1 - (R_s + R_p) / 2 by Fresnel's equations for one surface.
    """
    return _enter(math.radians(angle_deg), refractive_index) / _enter(0.0, refractive_index)


def _enter(angle: float, index: float) -> float:
    outside, inside = math.cos(angle), math.sqrt(1.0 - (math.sin(angle) / index) ** 2)
    r_s = ((outside - index * inside) / (outside + index * inside)) ** 2
    r_p = ((inside - index * outside) / (inside + index * outside)) ** 2
    return 1.0 - 0.5 * (r_s + r_p)


def sun_angle_deg(sun: SunPosition, *, yaw_deg: float, pitch_deg: float, roll_deg: float) -> float:
    """Compute the angle between a sensor's upward normal and the sun.

    Parameters
    ----------
    sun : SunPosition
        Position of the sun.
    yaw_deg, pitch_deg, roll_deg : float
        Attitude [deg]. It rotates the body (x forward, y right, z down) from
        north-east-down: yaw, then pitch, then roll.

    Returns
    -------
    float
        Angle [deg].
    """
    yaw, pitch, roll = (math.radians(angle) for angle in (yaw_deg, pitch_deg, roll_deg))
    normal = (
        -(math.cos(yaw) * math.sin(pitch) * math.cos(roll) + math.sin(yaw) * math.sin(roll)),
        -(math.sin(yaw) * math.sin(pitch) * math.cos(roll) - math.cos(yaw) * math.sin(roll)),
        -math.cos(pitch) * math.cos(roll),
    )
    elevation, azimuth = math.radians(sun.elevation_deg), math.radians(sun.azimuth_deg)
    towards = (
        math.cos(azimuth) * math.cos(elevation),
        math.sin(azimuth) * math.cos(elevation),
        -math.sin(elevation),
    )
    cosine = sum(a * b for a, b in zip(normal, towards, strict=True))
    return math.degrees(math.acos(max(-1.0, min(1.0, cosine))))


def level_factor(angle_deg: float, tilt: Tilt) -> float:
    """Compute the factor that converts a reading to the irradiance on a level surface.

    Parameters
    ----------
    angle_deg : float
        Angle between the sensor's normal and the sun [deg].
    tilt : Tilt
        Position of the sun, and assumptions.

    Notes
    -----
    A reading is direct light times cosine times T plus diffuse light, which has no
    direction here [1]_::

        reading = H ((1 - d) cos(a) T(a) / cos(z) + d)

    H is the horizontal irradiance, d its diffuse fraction (d/(1 - d) = 1/5 as in
    MicaSense's light sensor notes), a the angle to the sun, z the zenith angle. What
    the diffuser loses of diffuse light is a constant, which K contains.

    Limits: the fraction d is an assumption; part of the sky and the ground that a
    tilted sensor sees is left out; the attitude's yaw comes from a compass beside
    motors. At a sun of 45 degrees each degree of tilt towards it is 1.5 %.

    References
    ----------
    .. [1] J. A. Duffie, W. A. Beckman, Solar Engineering of Thermal Processes,
           section 2.15 (isotropic sky)
    """
    zenith_deg = 90.0 - tilt.sun.elevation_deg
    return 1.0 / _respond(angle_deg, zenith_deg, tilt.params, tilt.params.diffuse_share)


def attitude_u_rel(angle_deg: float, tilt: Tilt, *, u_deg: float) -> float:
    """Compute the relative standard uncertainty of a reading from that of its attitude."""
    zenith_deg, share = 90.0 - tilt.sun.elevation_deg, tilt.params.diffuse_share
    low, middle, high = (
        _respond(angle, zenith_deg, tilt.params, share)
        for angle in (abs(angle_deg - u_deg), angle_deg, min(90.0, angle_deg + u_deg))
    )
    return math.hypot((high - low) / 2.0, (high + low) / 2.0 - middle) / middle


def diffuse_u_rel(angle_deg: float, tilt: Tilt) -> float:
    """Compute the relative standard uncertainty of a levelled reading from that of the diffuse fraction."""
    # the response is a line in the fraction, from direct light alone to 1
    direct = _respond(angle_deg, 90.0 - tilt.sun.elevation_deg, tilt.params, 0.0)
    return abs(1.0 - direct) * tilt.params.diffuse_share_u * level_factor(angle_deg, tilt)


def _respond(angle_deg: float, zenith_deg: float, params: TiltParams, share: float) -> float:
    direct = math.cos(math.radians(angle_deg)) * transmit(angle_deg, refractive_index=params.refractive_index)
    return (1.0 - share) * direct / math.cos(math.radians(zenith_deg)) + share


def read_clock(header: FrameHeader) -> datetime | None:
    """Return the time of the exposure."""
    if header.taken_at is None:
        return None
    at = datetime.fromisoformat(header.taken_at)
    return at if at.tzinfo is not None else at.replace(tzinfo=UTC)


def read_clock_s(header: FrameHeader) -> float | None:
    """Return the time of the exposure in seconds since 1970."""
    at = read_clock(header)
    return at.timestamp() if at is not None else None


def locate_sun_of(header: FrameHeader) -> SunPosition | None:
    at, band = read_clock(replace(header, taken_at=header.zoned_at)), header.multispectral
    if at is not None and (not has_set_clock(at) or _lacks_zone(header)):
        at = None
    if at is not None and header.latitude_deg is not None and header.longitude_deg is not None:
        return locate_sun(at, latitude_deg=header.latitude_deg, longitude_deg=header.longitude_deg)
    light = band.irradiance if band is not None else None
    if light is None or light.solar_elevation_deg is None or light.solar_azimuth_deg is None:
        return None
    return SunPosition(elevation_deg=light.solar_elevation_deg, azimuth_deg=light.solar_azimuth_deg)


def _lacks_zone(header: FrameHeader) -> bool:
    stated = datetime.fromisoformat(header.zoned_at or "").tzinfo is not None
    return not stated and header.multispectral is not None and not writes_utc(header.multispectral.system)


def find_tilt(header: FrameHeader, params: TiltParams | None) -> Tilt | None:
    """Return the tilt correction of a frame with the position of the sun."""
    if params is None:
        return None
    sun = locate_sun_of(header)
    if sun is None:
        placed = header.latitude_deg is not None and header.longitude_deg is not None
        cause = (
            "The camera's clock states no time zone, and none is stated for its campaign or organisation"
            if placed and header.taken_at and _lacks_zone(header)
            else "The file does not state when and where it was taken (no GPS fix)"
        )
        raise InputRejected(codes.TILT_NOT_CORRECTABLE, f"{cause}: the position of the sun is not known.")
    require_high_sun(sun)
    return Tilt(sun=sun, params=params)
