"""Effect of a distortion coefficient on the image, in the corner of the frame."""

import math
from collections.abc import Mapping
from typing import Final

_RADIAL: Final = {"k1": 3, "k2": 5, "k3": 7}

DISTORTION: Final = frozenset({*_RADIAL, "p1", "p2"})


def move_corner(name: str, means: Mapping[str, float]) -> float:
    """Return the image motion in the frame's corner per unit of a distortion coefficient.

    Parameters
    ----------
    name : str
        Coefficient: k1, k2, k3, p1 or p2.
    means : mapping
        Values of fx_px, fy_px, cx_px and cy_px by name [px].

    Returns
    -------
    float
        Motion [px]; NaN if one of the four values is missing.
    """
    try:
        fx, fy, cx, cy = (means[f"{each}_px"] for each in ("fx", "fy", "cx", "cy"))
    except KeyError:
        return math.nan
    x, y = cx / fx, cy / fy
    squared = x * x + y * y
    if name in _RADIAL:
        power = (_RADIAL[name] - 1) / 2
        return float(math.hypot(fx * x, fy * y) * squared**power)
    if name == "p1":
        return math.hypot(fx * 2 * x * y, fy * (squared + 2 * y * y))
    return math.hypot(fx * (squared + 2 * x * x), fy * 2 * x * y)
