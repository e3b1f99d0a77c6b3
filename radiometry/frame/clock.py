"""Clocks of cameras: whether one was ever set, and whether it shows UTC."""

from datetime import datetime
from typing import Final

EARLIEST_YEAR: Final = 2000
"""A clock that was never set starts in 1970, or when a GPS week begins: 1980."""
_LOCAL_CLOCKS = frozenset({"dji"})
"""These write the time of day of the place, without its offset."""


def has_set_clock(at: datetime) -> bool:
    """Return True unless a time lies before any of these cameras was built.

    Parameters
    ----------
    at : datetime
        Time as a file states it.
    """
    return at.year >= EARLIEST_YEAR


def writes_utc(system: str | None) -> bool:
    """Return True for a family of multispectral cameras that writes UTC without saying so.

    Parameters
    ----------
    system : str or None
        As in `Multispectral.system`; None for any other camera.
    """
    return system is not None and system not in _LOCAL_CLOCKS
