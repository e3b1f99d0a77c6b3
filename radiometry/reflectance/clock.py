"""Time of a frame, and position of the sun at that time."""

from dataclasses import replace
from datetime import UTC, datetime

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader
from radiometry.frame.clock import has_set_clock, writes_utc
from radiometry.reflectance import codes
from radiometry.reflectance.sun import SunPosition, locate_sun
from radiometry.reflectance.tilt import Tilt, TiltParams, require_high_sun


def read_clock(header: FrameHeader) -> datetime | None:
    """Return the time of the exposure.

    Returns
    -------
    datetime or None
        None if the file has no time. Parrot and MicaSense write UTC; an offset in
        the file is used.
    """
    if header.taken_at is None:
        return None
    at = datetime.fromisoformat(header.taken_at)
    return at if at.tzinfo is not None else at.replace(tzinfo=UTC)


def read_clock_s(header: FrameHeader) -> float | None:
    """Return the time of the exposure in seconds since 1970.

    Returns
    -------
    float or None
        Time [s]; None if the file has none.
    """
    at = read_clock(header)
    return at.timestamp() if at is not None else None


def locate_sun_of(header: FrameHeader) -> SunPosition | None:
    """Return the position of the sun over a frame.

    Returns
    -------
    SunPosition or None
        By time and place, else as the file states it; None if neither is known: of a
        clock before 2000, which was never set, or of a local time without a stated offset.
    """
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
    """Return the tilt correction of a frame with the position of the sun.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the frame.
    params : TiltParams or None
        Assumptions of the correction; None for no correction.

    Returns
    -------
    Tilt or None
        None if no correction is requested.

    Raises
    ------
    InputRejected
        `tilt_not_correctable` if position, time or its zone is not known, or the sun
        is too low.
    """
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
