"""Lanes between two luminaires as a grid of cells in one frame, for a measurement of luminance."""

import math
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from radiometry.frame.grid import Grid, stretch_corners
from radiometry.records import Record
from radiometry.road.grid import count_points, lay_points
from radiometry.road.placing import Lens, Mark, place_frame
from radiometry.road.rules import GridRule
from radiometry.road.site import Row, Site, Strip

_RULE: Final = GridRule(fewest_along=10, widest_along_m=3.0, fewest_across=3, widest_across_m=math.inf)
"""For luminances, EN 13201-3:2015."""

_NO_CAMERA: Final = Lens(np.eye(3))


class LaneGrid(Record):
    """Lanes between two luminaires, seen in perspective."""

    #: Image (x, y) [px] of a rectangle as wide as all lanes, its first side along them
    corners: tuple[tuple[float, float], ...]
    lanes: int
    lane_width_m: float  #: Width of a lane and spacing of the luminaires [m]
    spacing_m: float
    length_m: float  #: Length of the rectangle along the lanes [m]; the field begins at its first corner
    corner_u_px: float  #: Standard uncertainty of each coordinate of a corner [px]

    @property
    def rows(self) -> int:
        """Number of points across all lanes."""
        return _RULE.fewest_across * self.lanes

    @property
    def columns(self) -> int:
        """Number of points along."""
        return count_points(self.spacing_m, _RULE.fewest_along, _RULE.widest_along_m)


def lay_lanes(lanes: LaneGrid) -> Grid:
    """Return the grid of the field between two luminaires: points of the standard are the cells' centres.

    Parameters
    ----------
    lanes : LaneGrid
        Lanes and the marked rectangle.
    """
    corners, share = lanes.corners, None
    if lanes.spacing_m != lanes.length_m:
        try:
            moved = stretch_corners(np.array(corners, np.float64), lanes.spacing_m / lanes.length_m)
            corners, share = tuple((float(x), float(y)) for x, y in moved), lanes.length_m / lanes.spacing_m
        except np.linalg.LinAlgError:  # three on one line: the grid is refused for that
            pass
    return Grid(
        corners=corners,
        rows=lanes.rows,
        columns=lanes.columns,
        aspect=lanes.spacing_m / (lanes.lanes * lanes.lane_width_m),
        corner_u_px=lanes.corner_u_px,
        marked_share=share,
    )


def describe_lanes(lanes: LaneGrid) -> dict[str, Any]:
    """Return the geometry of a field, ready for JSON: its points on the road, and how well they are known.

    Parameters
    ----------
    lanes : LaneGrid
        Lanes and the marked rectangle, whose corners are those of a convex quadrilateral.

    Returns
    -------
    dict
        ``points_m``: (x, y) along and across from the first corner, row by row; ``along_m``, ``across_m``:
        their distances; ``point_u_m``: largest standard uncertainty of a point's place on the road, from that
        of the corners alone.
    """
    width_m, row = lanes.lane_width_m, Row(y_m=0.0, height_m=1.0, spacing_m=lanes.spacing_m)
    strips = (Strip(name=str(n), kind="lane", y_m=n * width_m, width_m=width_m) for n in range(lanes.lanes))
    points = np.array([(p.x_m, p.y_m) for p in lay_points(Site(rows=(row,), strips=tuple(strips)), _RULE)])
    far = lanes.length_m, lanes.lanes * width_m
    marks = [
        Mark(x_px=x_px, y_px=y_px, x_m=x * far[0], y_m=y * far[1], u_m=0.0)
        for (x_px, y_px), (x, y) in zip(lanes.corners, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True)
    ]
    spread = place_frame(marks, _NO_CAMERA, u_px=lanes.corner_u_px).find_covariances(points)
    stated = asdict(lanes)
    return {
        "marked": [list(corner) for corner in stated.pop("corners")],
        **stated,
        "along_m": lanes.spacing_m / lanes.columns,
        "across_m": width_m / _RULE.fewest_across,
        "points_m": np.round(points, 6).reshape(lanes.rows, lanes.columns, 2).tolist(),
        "point_u_m": math.sqrt(np.trace(spread, axis1=1, axis2=2).max()),
    }
