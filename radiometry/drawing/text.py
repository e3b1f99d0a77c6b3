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
    return f"1/{1.0 / seconds:.4g} s" if seconds < 0.3 else f"{seconds:.3g} s"


def sort_naturally(names: Iterable[str]) -> list[str]:
    """Return names in natural order: scene 9 before scene 10.

    Parameters
    ----------
    names : iterable of str
        Names.
    """
    return sorted(
        names,
        key=lambda name: [(part.isdigit(), part.zfill(20)) for part in re.split(r"(\d+)", name.lower())],
    )


def write_unit(unit: str) -> str:
    """Return a unit as print sets it, from the way in which it is typed.

    Parameters
    ----------
    unit : str
        Unit, such as DN*m2/(cd*s).
    """
    return unit.replace("*", "·").replace("m2", "m²")
