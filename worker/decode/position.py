"""Where the camera was, from the GPS directory beside EXIF."""

import math
from dataclasses import dataclass
from typing import Final

from radiometry.findings import InputRejected
from radiometry.frame import PositionFix
from worker.decode import tags
from worker.decode.tiff import Directory
from worker.decode.xmp import Xmp

_BELOW_SEA_LEVEL: Final = 1
_HIGHEST_M: Final = 1e5
_FIXES: Final = (
    (range(1), "none"),
    (range(16, 17), "single"),
    (range(32, 50), "float"),
    (range(50, 51), "fixed"),
)


@dataclass(frozen=True, kw_only=True)
class Position:
    """Latitude and longitude come together or not at all; an altitude only with them."""

    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None


def read_position(main: Directory) -> Position:
    """Read the position that the file states, unless it says that it does not know.

    Not known: no hemisphere, a zero denominator, an interrupted fix (status V), and zero degrees both ways,
    which is what a receiver without a fix writes.
    """
    try:
        gps = main.directory(tags.GPS)
        if gps is None or _letter(gps, tags.GPS_STATUS) == "V":
            return Position()
        latitude = _angle(gps, tags.GPS_LATITUDE, tags.GPS_LATITUDE_REF, "NS", 90.0)
        longitude = _angle(gps, tags.GPS_LONGITUDE, tags.GPS_LONGITUDE_REF, "EW", 180.0)
    except InputRejected:
        return Position()
    if latitude is None or longitude is None or latitude == longitude == 0.0:
        return Position()
    return Position(latitude_deg=latitude, longitude_deg=longitude, altitude_m=_altitude(gps))


def read_fix(xmp: Xmp) -> PositionFix | None:
    """How good a DJI aircraft says that its position is, by RtkFlag and its deviations."""
    state = xmp.index("drone-dji:RtkFlag")
    if state is None:
        return None
    deviations = [xmp.number(f"drone-dji:RtkStd{axis}") for axis in ("Lat", "Lon", "Hgt")]
    latitude, longitude, height = (each if each and 0.0 < each < _HIGHEST_M else None for each in deviations)
    kind = next((kind for states, kind in _FIXES if state in states), "other")
    return PositionFix(kind=kind, u_latitude_m=latitude, u_longitude_m=longitude, u_height_m=height)


def read_height(xmp: Xmp) -> float | None:
    """Read the height above the take-off point, by the barometer of a DJI aircraft [m]."""
    height = xmp.number("drone-dji:RelativeAltitude")
    return height if height is not None and abs(height) <= _HIGHEST_M else None


def _angle(gps: Directory, tag: int, ref: int, letters: str, largest_deg: float) -> float | None:
    """Degrees, minutes and seconds; writers that need no seconds put them into the fraction before."""
    parts = gps.numbers(tag, at_most=3)
    letter = _letter(gps, ref)
    stated = [float(part) for part in parts if part is not None and part >= 0]
    if not parts or len(stated) < len(parts) or not letter or letter not in letters:
        return None
    degrees = math.fsum(part / 60.0**power for power, part in enumerate(stated))
    if degrees > largest_deg:
        return None
    return degrees if letter == letters[0] else -degrees


def _altitude(gps: Directory) -> float | None:
    try:
        stated = gps.numbers(tags.GPS_ALTITUDE, at_most=1)
        below = gps.numbers(tags.GPS_ALTITUDE_REF, at_most=1) == [_BELOW_SEA_LEVEL]
    except InputRejected:
        return None
    if not stated or stated[0] is None or abs(stated[0]) > _HIGHEST_M:
        return None
    return -stated[0] if below else stated[0]


def _letter(gps: Directory, tag: int) -> str:
    return gps.raw(tag, at_most=8).split(b"\0", 1)[0].decode("latin-1").strip().upper()
