"""Regions as requests state them: in an address or a header, or in a body."""

import json

from pydantic import ValidationError

from radiometry.fitting.evidence import Region
from radiometry.frame.grid import Grid, LaneGrid, lay_lanes
from radiometry.frame.roi import Polygon, parse_imagej
from service.problems import invalid, located
from service.schemas.campaigns import NewRoi
from service.schemas.measurements import NewGrid
from store.queries.campaigns import Drawing


def read_region(text: str) -> NewRoi:
    """Read a region as an address or a header holds it."""
    try:
        if text.lstrip().startswith("["):
            return NewRoi.model_validate({"polygon": json.loads(text)})
        return NewRoi(imagej=text)
    except ValidationError as error:
        raise invalid(located(error, "query", "roi")) from error
    except (ValueError, RecursionError) as error:
        message = "must be [[x,y],...] or makePolygon(...)"
        raise invalid([{"type": "region", "loc": ("query", "roi"), "msg": message}]) from error


def read_roi(body: NewRoi) -> Drawing:
    """Return the region as it is stored, with its corners in the order in which they were given."""
    if body.regions is not None:
        return Drawing.of_parts(
            [Region(name=part.name, polygon=Polygon.from_points(part.polygon)) for part in body.regions]
        )
    if body.polygon is not None:
        return Drawing(polygon=Polygon.from_points(body.polygon), corners=body.polygon)
    polygon = parse_imagej(body.imagej or "")
    return Drawing(polygon=polygon, corners=polygon.points)


def read_grid(asked: NewGrid) -> tuple[Grid, LaneGrid | None]:
    """Return the cells of a grid, and its geometry where it is one of lanes."""
    corners = tuple((corner[0], corner[1]) for corner in asked.corners)
    if asked.lanes and asked.lane_width_m and asked.spacing_m:
        lanes = LaneGrid(
            corners=corners,
            lanes=asked.lanes,
            lane_width_m=asked.lane_width_m,
            spacing_m=asked.spacing_m,
            length_m=asked.length_m or asked.spacing_m,
            corner_u_px=asked.corner_u_px,
        )
        return lay_lanes(lanes), lanes
    rows, columns = asked.rows or 0, asked.columns or 0
    return Grid(corners=corners, rows=rows, columns=columns, corner_u_px=asked.corner_u_px), None
