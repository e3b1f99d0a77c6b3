"""Grid of equal cells on a rectangular surface, by the image of its corners."""

from dataclasses import dataclass
from typing import Final

MAX_CELLS_A_SIDE: Final = 50


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Equal cells of a rectangular surface, by the image of its corners.

    ``corners`` : (x, y) [px] of the surface's top-left, top-right, bottom-right, bottom-left corner, as the
        surface runs, whichever way it lies in the image
    """

    corners: tuple[tuple[float, float], ...]
    rows: int
    columns: int
