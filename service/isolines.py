"""Answer of isolines."""

import math

import numpy as np
from numpy.typing import NDArray

from radiometry.findings import interface
from radiometry.maps import (
    MOST_VERTICES,
    TOLERANCE,
    Isoline,
    choose_levels,
    choose_step,
    is_ragged,
    place_on_earth,
    place_on_road,
    trace_isolines,
)
from service.map_tools import MOST_SQUARES, OpenMap, frame_window, read_squares
from service.map_values import Values
from service.problems import Problem, invalid
from service.schemas.map_tools import (
    Coordinates,
    IsolineFeature,
    IsolineGeometry,
    IsolineProperties,
    IsolinesAnswer,
    LevelsOfMap,
)

Array = NDArray[np.float64]

_FEWEST_SQUARES = 16  # along a side of the area, for the sake of noise
_LEVEL_ENDS = (1.0, 99.0)


def answer_isolines(found: OpenMap, asked: LevelsOfMap) -> IsolinesAnswer:
    coordinates = _choose_coordinates(found, asked)
    area = "grid" if coordinates == "road_m" else asked.area
    polygon = found.find_polygon(area)
    window = frame_window(found.layout, polygon)
    pixels = (window.bottom - window.top) * (window.right - window.left)
    levels = asked.read_levels()
    coarse = choose_step((), pixels=pixels, most=MOST_SQUARES, uncertainty=None)
    if not levels:
        levels = _find_levels(found, read_squares(found, window, polygon, step=max(coarse, 4))[0])
    step = asked.step or choose_step(levels, pixels=pixels, most=MOST_SQUARES, uncertainty=found.uncertainty)
    if asked.step is not None and pixels / step**2 > MOST_SQUARES:
        message = f"{pixels // step**2} squares are too many: take a step of {coarse} or more"
        raise invalid([{"type": "step", "loc": ("query", "step"), "msg": message}])
    while True:
        plane, squares = read_squares(found, window, polygon, step=step)
        if min(plane.shape) < 2:
            message = f"the area holds fewer than 2 x 2 squares of {step} pixels: take a smaller step"
            raise invalid([{"type": "step", "loc": ("query", "step"), "msg": message}])
        lines = trace_isolines(plane, levels, step=step, left_px=window.left, top_px=window.top)
        vertices = sum(len(line) for each in lines for line in each.lines)
        if vertices <= MOST_VERTICES and (asked.step or not is_ragged(lines, found.uncertainty, step=step)):
            break
        if vertices <= MOST_VERTICES and 2 * step > math.isqrt(pixels) // _FEWEST_SQUARES:
            break
        if asked.step is not None:
            message = f"the lines have {vertices} points: take a larger step, or fewer levels"
            raise invalid([{"type": "step", "loc": ("query", "step"), "msg": message}])
        step *= 2
    place = found.row.result.get("place", {})
    return IsolinesAnswer(
        type="FeatureCollection",
        coordinates_in=coordinates,
        area=area,
        step_px=step,
        tolerance_px=TOLERANCE * step,
        vertices=vertices,
        unknown_share=1.0 - float(np.isfinite(plane).sum()) / max(1, squares),
        place_u_m=math.hypot(place["u_corner_m"], place["residual_m"]) if coordinates == "wgs84" else None,
        notes=found.list_notes(),
        features=[_make_feature(found, each, step, coordinates) for each in lines],
    )


def _choose_coordinates(found: OpenMap, asked: LevelsOfMap) -> Coordinates:
    is_placed = bool(found.row.result.get("place", {}).get("transform"))
    chosen = asked.coordinates or ("wgs84" if is_placed else "pixel")
    if chosen == "wgs84" and not is_placed:
        raise Problem(interface.NOT_FOUND, "This map has no place: its isolines have pixel coordinates.")
    if chosen == "road_m" and not found.row.parameters.get("lanes"):
        raise Problem(interface.NOT_FOUND, "This measurement has no lanes: take `pixel` coordinates.")
    return chosen


def _find_levels(found: OpenMap, plane: Values) -> list[float]:
    """Return round levels between the percentiles of what is distinguished from zero."""
    known = plane[np.isfinite(plane)]
    if found.is_light:
        limit = found.uncertainty.limit if found.uncertainty else 0.0
        known = known[known > max(limit, 0.0)]
    if not known.size:
        return []
    low, high = np.percentile(known, _LEVEL_ENDS)
    return list(choose_levels(float(low), float(high), logarithmic=found.is_light))


def _make_feature(found: OpenMap, isoline: Isoline, step: int, coordinates: Coordinates) -> IsolineFeature:
    known = found.uncertainty
    properties = IsolineProperties(
        level=isoline.level,
        unit=found.unit,
        too_dark=bool(known and found.is_light and isoline.level < known.limit),
        lines=len(isoline.lines),
        rings_left_out=isoline.rings_left_out,
    )
    if known is not None:
        at = np.array(isoline.level)
        common, own = float(known.common(at)), float(known.own(at, float(step**2)))
        properties.standard_uncertainty, properties.own_uncertainty = common, own
        if isoline.slope_per_px:
            properties.place_u_px = math.hypot(common, own) / isoline.slope_per_px
    lines = [_place(found, line, coordinates) for line in isoline.lines]
    return IsolineFeature(
        type="Feature",
        id=f"{isoline.level:g}",
        geometry=IsolineGeometry(
            type="MultiLineString", coordinates=[line.tolist() for line in lines if line is not None]
        ),
        properties=properties,
    )


def _place(found: OpenMap, line: Array, coordinates: Coordinates) -> Array | None:
    if coordinates == "wgs84":
        # 1e-8 degrees are a millimetre
        return np.round(place_on_earth(found.row.result["place"]["transform"], line), 8)
    if coordinates == "road_m":
        placed = place_on_road(found.row.parameters["lanes"], line)
        return None if placed is None else np.round(placed, 4)
    return np.round(line, 2)
