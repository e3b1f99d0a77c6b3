"""Time of a frame, and position of the sun at that time."""

from datetime import UTC, datetime

from radiometry.findings import InputRejected
from radiometry.frame import FrameHeader
from radiometry.reflectance import codes
from radiometry.reflectance.sun import locate_sun
from radiometry.reflectance.tilt import Tilt, TiltParams, require_high_sun


def read_clock(header: FrameHeader) -> datetime | None:
    """Return the time of the exposure.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the frame.

    Returns
    -------
    datetime or None
        None if the file has no time. Both manufacturers write UTC; an offset in the
        file is used.
    """
    if header.taken_at is None:
        return None
    at = datetime.fromisoformat(header.taken_at)
    return at if at.tzinfo is not None else at.replace(tzinfo=UTC)


def read_clock_s(header: FrameHeader) -> float | None:
    """Return the time of the exposure in seconds since 1970.

    Parameters
    ----------
    header : FrameHeader
        Metadata of the frame.

    Returns
    -------
    float or None
        Time [s]; None if the file has none.
    """
    at = read_clock(header)
    return at.timestamp() if at is not None else None


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
        `tilt_not_correctable` if the file lacks position or time, or the sun is too
        low.
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
