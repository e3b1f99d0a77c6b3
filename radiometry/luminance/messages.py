"""Exposure settings and stops, written as a photographer reads them."""

import math

from radiometry.frame.exposure import Settings

_THIRDS = ("", " 1/3", " 2/3")


def show_time(time_s: float) -> str:
    """Format an exposure time as it is marked: 1/125 s, 0.5 s, 2 s.

    Parameters
    ----------
    time_s : float
        Exposure time [s].

    Returns
    -------
    str
        Text with its unit.
    """
    reciprocal = round(1.0 / time_s)
    if reciprocal > 2 and abs(time_s * reciprocal - 1.0) < 0.01:
        return f"1/{reciprocal} s"
    return f"{time_s:g} s"


def show_settings(settings: Settings) -> str:
    """Format the three values of an exposure.

    Parameters
    ----------
    settings : Settings
        ISO value, exposure time and f-number.

    Returns
    -------
    str
        Text such as "ISO 3200, 1/125 s, f/4".
    """
    return f"ISO {settings.iso:g}, {show_time(settings.exposure_time_s)}, f/{settings.f_number:g}"


def show_stops(ratio: float) -> str:
    """Format a ratio of light in stops, rounded up to the thirds that a camera can set.

    Parameters
    ----------
    ratio : float
        Ratio above 1.

    Returns
    -------
    str
        Number of stops, at least one third, with its unit.
    """
    thirds = max(1, math.ceil(3.0 * math.log2(ratio) - 1e-9))
    whole, rest = divmod(thirds, 3)
    number = (f"{whole}" if whole else "") + _THIRDS[rest]
    return f"{number.strip()} {'stop' if thirds <= 3 else 'stops'}"
