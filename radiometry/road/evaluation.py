"""Evaluation of a road."""

from collections.abc import Sequence

from radiometry.road import codes
from radiometry.road.grid import GridPoint
from radiometry.road.results import RoadResult
from radiometry.road.site import Reading, Road, Scale


def evaluate_road(
    road: Road, points: Sequence[GridPoint], readings: Sequence[Reading], *, scale: Scale
) -> RoadResult:
    """Evaluate a road from luminances of its grid and control points."""
    raise codes.SITE_INVALID.refuse(f"Not yet: {road} {points} {readings} {scale}")
