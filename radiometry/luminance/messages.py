"""Exposure settings and stops, written as a photographer reads them."""

import math

from radiometry.frame.exposure import Settings

_THIRDS = ("", " 1/3", " 2/3")


def show_time(time_s: float) -> str:
    """Write an exposure time as it is marked: 1/125 s, 0.5 s, 2 s."""
    reciprocal = round(1.0 / time_s)
    if reciprocal > 2 and abs(time_s * reciprocal - 1.0) < 0.01:
        return f"1/{reciprocal} s"
    return f"{time_s:g} s"


def show_settings(settings: Settings) -> str:
    """Write the three numbers of an exposure."""
    return f"ISO {settings.iso:g}, {show_time(settings.exposure_time_s)}, f/{settings.f_number:g}"


def show_stops(ratio: float) -> str:
    """Write a ratio of light, > 1, in stops, rounded up to the thirds that a camera can set, at least one."""
    thirds = max(1, math.ceil(3.0 * math.log2(ratio) - 1e-9))
    whole, rest = divmod(thirds, 3)
    number = (f"{whole}" if whole else "") + _THIRDS[rest]
    return f"{number.strip()} {'stop' if thirds <= 3 else 'stops'}"
