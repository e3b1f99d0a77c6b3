"""Layout of a map's picture: the map in its left upper corner, squares of its pixels to one, then the bar."""

import math
from typing import Final

WIDEST_PX: Final = 1600
"""Of the picture."""

BAR_PX: Final = 200
"""Of its width: the bar and its labels."""


def find_step(width_px: int) -> int:
    """Return how many pixels of the map, along each side, are one of its picture.

    Parameters
    ----------
    width_px : int
        Width of the map.
    """
    return max(1, math.ceil(width_px / (WIDEST_PX - BAR_PX)))
