"""Names and numbers as plots write them."""

import re
from collections.abc import Iterable


def write_exposure(seconds: float) -> str:
    """Return an exposure time as a camera names it: 1/250 s, 2 s.

    Parameters
    ----------
    seconds : float
        Exposure time [s].
    """
    if seconds >= 0.3:
        return f"{seconds:.3g} s"
    whole = round(1.0 / seconds)
    return f"1/{whole} s" if abs(seconds * whole - 1.0) < 0.01 else f"1/{1.0 / seconds:.3g} s"


def natural_key(name: str) -> list[tuple[bool, str]]:
    """Return a key that sorts names in natural order: scene 9 before scene 10.

    Parameters
    ----------
    name : str
        A name.
    """
    parts = re.split(r"(\d+)", name.lower())
    return [(part.isdigit(), part.zfill(20) if part.isdigit() else part) for part in parts]


def sort_naturally(names: Iterable[str]) -> list[str]:
    """Return names in natural order.

    Parameters
    ----------
    names : iterable of str
        Names.
    """
    return sorted(names, key=natural_key)


def write_unit(unit: str) -> str:
    """Return a unit as print sets it, from the way in which it is typed.

    Parameters
    ----------
    unit : str
        Unit, such as DN*m2/(cd*s).
    """
    return unit.replace("*", "·").replace("m2", "m²")
