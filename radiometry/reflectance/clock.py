"""When a frame was taken, and where the sun stood."""

from datetime import UTC, datetime

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader
from radiometry.reflectance import codes
from radiometry.reflectance.sun import locate_sun
from radiometry.reflectance.tilt import Tilt, TiltParams, require_high_sun


def read_clock(header: FrameHeader) -> datetime | None:
    """Give the time of the exposure; both makers write UTC, and where a file has an offset it counts."""
    if header.taken_at is None:
        return None
    at = datetime.fromisoformat(header.taken_at)
    return at if at.tzinfo is not None else at.replace(tzinfo=UTC)


def read_clock_s(header: FrameHeader) -> float | None:
    """Give the same in seconds since 1970; None where the file has no time."""
    at = read_clock(header)
    return at.timestamp() if at is not None else None


def find_tilt(header: FrameHeader, params: TiltParams | None) -> Tilt | None:
    """Give the sun over a frame, or None where no correction is wanted.

    Raises InputRejected(tilt_not_correctable) if the file lacks position or time, or the sun is too low
    """
    if params is None:
        return None
    at = read_clock(header)
    if at is None or header.latitude_deg is None or header.longitude_deg is None:
        raise InputRejected(
            codes.TILT_NOT_CORRECTABLE,
            "The file does not say when and where it was taken (no GPS fix): where the sun stood is not "
            "known. Fit without the tilt correction.",
        )
    sun = locate_sun(at, latitude_deg=header.latitude_deg, longitude_deg=header.longitude_deg)
    require_high_sun(sun)
    return Tilt(sun=sun, params=params)
