"""Points of a grid on lanes, walkways and areas, and the squares around them."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from radiometry.records import Record, about
from radiometry.road import codes
from radiometry.road.rules import GridRule
from radiometry.road.site import PLACES_M, Area, Site, Strip

Array = NDArray[np.float64]
MOST_POINTS = 2500
_SAME_M = 1e-6
_MOST_ROWS, _FEWEST_CORNERS = 50, 3


class GridPoint(Record):
    """A point of the grid."""

    name: str = about('Name: part, row across and column along, such as "1/2-7".')
    part: str = about("Lane, walkway, edge or area on which it lies.")
    row: int = about("Row across, from 1.")
    column: int = about("Column along, from 1.")
    x_m: float = about("Place along the road [m].")
    y_m: float = about("Place across [m].")


def count_points(length_m: float, fewest: int, widest_m: float) -> int:
    """Return the number of points over a length: the fewest that are at most so far apart."""
    return max(fewest, math.ceil(length_m / widest_m - 1e-9))


def lay_points(site: Site, rule: GridRule) -> tuple[GridPoint, ...]:
    """Lay the points of a grid, each in the middle of its share of the field.

    Along, D = S / N and the first point D / 2 from a luminaire; across, d = W / n and the first row d / 2
    from the edge of each lane, walkway or edge [1]. Inside each edge the same points are laid on the lanes,
    to compare with. An area has a square lattice no wider apart than either limit.

    [1] EN 13201-3:2015, Road lighting, Part 3: Calculation of performance.

    Parameters
    ----------
    site : Site
        Luminaires and surfaces.
    rule : GridRule
        Number of points and their largest distances.
    """
    _check(site)
    low, high = site.field_m
    along = _divide(low, high, count_points(high - low, rule.fewest_along, rule.widest_along_m))
    points: list[GridPoint] = []
    for strip in (*site.lanes, *(each for each in site.strips if each.kind != "lane")):
        for name, near in _place_strip(site, strip):
            rows = count_points(strip.width_m, rule.fewest_across, rule.widest_across_m)
            _require_few(len(points) + rows * len(along))
            points += _name(name, along, _divide(near, near + strip.width_m, rows))
    for area in site.areas:
        points += _fill(area, min(rule.widest_along_m, rule.widest_across_m))
        _require_few(len(points))
    return tuple(points)


def _require_few(count: int, most: int = MOST_POINTS) -> None:
    """Refuse more points than can be evaluated, before they are laid."""
    if count > most:
        raise codes.SITE_INVALID.refuse(f"The grid has {count} points, and at most {most}.")


def inside(edge: str) -> str:
    """Return the name of the part on the lanes that an edge is compared with."""
    return f"{edge} (inside)"


def outline_points(places_m: Array, sides_m: Array) -> Array:
    """Return the corners of rectangles of these sides, (n, 2), around places on the road: (n, 4, 2) [m]."""
    corners = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)])
    return np.asarray(places_m[:, None, :] + sides_m[:, None, :] * corners)


def find_distance(places_m: Iterable[float]) -> float:
    """Return the least distance between different places on one axis; 0 of one place."""
    apart = np.diff(sorted(places_m))
    return float(np.min(apart[apart > _SAME_M], initial=math.inf)) if np.any(apart > _SAME_M) else 0.0


def _check(site: Site) -> None:
    if not 1 <= len(site.rows) <= _MOST_ROWS:
        raise codes.SITE_INVALID.refuse("A site has 1 to 50 rows of luminaires.")
    names = [each.name for each in site.strips] + [each.name for each in site.areas]
    if not names or len(set(names)) < len(names):
        raise codes.SITE_INVALID.refuse("A site has lanes, walkways or areas of different names.")
    corners = [corner for area in site.areas for corner in area.corners_m]
    far = max((abs(at) for corner in corners for at in corner), default=0.0)
    if far > PLACES_M[1] or any(len(area.corners_m) < _FEWEST_CORNERS for area in site.areas):
        raise codes.SITE_INVALID.refuse("An area has three corners or more, each within 10 km.")


def _place_strip(site: Site, strip: Strip) -> list[tuple[str, float]]:
    """Return name and nearer edge of a strip; of an edge, those of its mirror on the lanes too."""
    placed = [(strip.name, strip.y_m)]
    if strip.kind == "edge" and site.lanes:
        near, far = site.lanes[0].y_m, max(lane.y_m + lane.width_m for lane in site.lanes)
        is_near = strip.y_m + strip.width_m / 2.0 < (near + far) / 2.0
        placed.append((inside(strip.name), near if is_near else far - strip.width_m))
    return placed


def _divide(low: float, high: float, count: int) -> Array:
    return low + (np.arange(count) + 0.5) * (high - low) / count


def _name(part: str, along: Array, across: Array) -> list[GridPoint]:
    return [
        GridPoint(name=f"{part}/{row + 1}-{col + 1}", part=part, row=row + 1, column=col + 1, x_m=x, y_m=y)
        for row, y in enumerate(across.tolist())
        for col, x in enumerate(along.tolist())
    ]


def _fill(area: Area, widest_m: float) -> list[GridPoint]:
    corners = np.array(area.corners_m, np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    counts = [count_points(size, 1, widest_m) for size in (high - low).tolist()]
    _require_few(math.prod(counts), 4 * MOST_POINTS)
    x, y = (_divide(*each) for each in zip(low, high, counts, strict=True))
    return [each for each in _name(area.name, x, y) if holds(corners, each.x_m, each.y_m)]


def holds(corners: Array, x: float, y: float) -> bool:
    """Return True if a place lies within a polygon, by the number of sides to its right."""
    (x0, y0), (x1, y1) = corners.T, np.roll(corners, -1, axis=0).T
    crosses = (y0 > y) != (y1 > y)
    at = x0 + (y - y0) / np.where(crosses, y1 - y0, 1.0) * (x1 - x0)
    return bool(np.sum(crosses & (at > x)) % 2)
