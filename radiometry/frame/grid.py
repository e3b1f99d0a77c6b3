"""Grid of equal cells on a rectangular surface, by the image of its corners."""

from dataclasses import dataclass, field
from typing import Final

from radiometry.specification.stored import LATER

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
    aspect : float or None, default: None
        Length of the surface along its rows over that along its columns; None if it
        is not stated.
    corner_u_px : float or None, default: None
        Standard uncertainty of each coordinate of a corner [px]; None of older
        measurements, which do not contain it.
    """

    corners: tuple[tuple[float, float], ...]
    rows: int
    columns: int
    aspect: float | None = field(default=None, metadata=LATER)
    corner_u_px: float | None = field(default=None, metadata=LATER)
