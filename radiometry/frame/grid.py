"""Grid of equal cells on a rectangular surface, by the image of its corners."""

from dataclasses import dataclass
from typing import Final

MAX_CELLS_A_SIDE: Final = 50


@dataclass(frozen=True, kw_only=True)
class Grid:
    """Equal cells of a rectangular surface, given by the image of its corners.

    Attributes
    ----------
    corners : tuple of tuple[float, float]
        (x, y) of the surface's top-left, top-right, bottom-right and bottom-left
        corner [px], in the orientation of the surface, whichever way it lies in the
        image.
    rows, columns : int
        Number of cells along the surface's sides.
    """

    corners: tuple[tuple[float, float], ...]
    rows: int
    columns: int
