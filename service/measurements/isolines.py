"""Isolines of a measurement's map."""

import math
from typing import Annotated, Literal

import numpy as np
from fastapi import Query, Request, Response
from numpy.typing import NDArray
from pydantic import AfterValidator

from radiometry import maps as science
from radiometry.findings import interface
from service.http import answers, lookup, models, operations
from service.http.context import UsesContext
from service.http.problems import Problem, wrong
from service.measurements import maps
from service.measurements.exports import GeoJson
from store.tables import Measurement

Coordinates = Literal["pixel", "road_m", "wgs84"]


_NUMBER = r"[-+]?[0-9]+(\.[0-9]+)?([eE][-+]?[0-9]{1,2})?"
# schemas only: what is refused is refused by the checks, with their words
_LEVELS = {"pattern": f"^{_NUMBER}(,{_NUMBER}){{0,{science.MOST_LEVELS - 1}}}$"}


def _check_levels(text: str) -> str:
    try:
        levels = [float(level) for level in text.replace(",", " ").split()]
    except ValueError:
        levels = []
    if not 1 <= len(levels) <= science.MOST_LEVELS or not all(map(math.isfinite, levels)):
        raise ValueError(
            f"must be 1 to {science.MOST_LEVELS} finite numbers with commas between, as in `0.5,1,2`"
        )
    return text


_AREA = (
    "`region`: that of the measurement. `grid`: the outline of its cells. `frame`: the whole map, lamps and "
    "sky included."
)


class LevelsOfMap(models.Form):
    """Levels of isolines, and the area in which they are traced."""

    levels: Annotated[
        str | None,
        AfterValidator(_check_levels),
        models.told(
            f"1 to {science.MOST_LEVELS} values in the map's unit, separated by commas. Left out: round "
            "ones between the 1st and the 99th percentile of the area.",
            max_length=500,
            examples=["0.5,1,2"],
            json_schema_extra=_LEVELS,
        ),
    ] = None
    area: maps.Area = models.told(_AREA, default="frame")
    step: int | None = models.maybe(
        "Side of the squares over which the map is averaged first [px]. Left out: as small "
        "as noise between neighbouring levels allows.",
        ge=1,
        le=1024,
    )
    coordinates: Coordinates | None = models.maybe(
        "`pixel`: x right, y down. `road_m`: along and across the lanes, inside the grid only. `wgs84`: "
        "longitude and latitude. Left out: `wgs84` where the map has a place, else `pixel`."
    )


class IsolineGeometry(models.Answer):
    type: Literal["MultiLineString"]
    coordinates: list[list[list[float]]]


class IsolineProperties(models.Answer):
    level: float
    unit: str
    standard_uncertainty: float | None = models.maybe(
        "Of the level, from what all pixels share: it moves all lines of it together."
    )
    own_uncertainty: float | None = models.maybe(
        "Upper bound of the noise of one square's mean: it ruffles the lines."
    )
    place_u_px: float | None = models.maybe(
        "Both uncertainties together, over the median slope across the lines."
    )
    too_dark: bool = models.told("True if the level is not distinguished from zero.")
    lines: int
    rings_left_out: int = models.told("Rings around a single square, which noise alone draws.")


class IsolineFeature(models.Answer):
    type: Literal["Feature"]
    id: str
    geometry: IsolineGeometry
    properties: IsolineProperties


class IsolinesAnswer(models.Answer):
    """Isolines in the form of GeoJSON, longitude and latitude only with `coordinates_in` `wgs84`."""

    type: Literal["FeatureCollection"]
    coordinates_in: Coordinates
    area: maps.Area
    step_px: int = models.told("Side of the squares [px] that are averaged: finer detail is not drawn.")
    tolerance_px: float = models.told("How far lines are moved where points are left out of them.")
    vertices: int = models.told(f"Of all lines; at most {science.MOST_VERTICES}.")
    unknown_share: float = models.told("Squares of the area with a saturated pixel; no line crosses them.")
    place_u_m: float | None = models.maybe("Of `wgs84`: largest, with that of the transformation.")
    notes: list[str] = models.told("What the uncertainty does not contain.")
    features: list[IsolineFeature]


Array = NDArray[np.float64]

_FEWEST_SQUARES = 16  # along a side of the area, for the sake of noise
_LEVEL_ENDS = (1.0, 99.0)


def answer_isolines(found: maps.OpenMap, asked: LevelsOfMap) -> IsolinesAnswer:
    coordinates = _choose_coordinates(found, asked)
    area = "grid" if coordinates == "road_m" else asked.area
    polygon = found.find_polygon(area)
    window = maps.frame_window(found.layout, polygon)
    pixels = window.height * window.width
    levels = sorted({float(level) for level in (asked.levels or "").replace(",", " ").split()})
    coarse = science.choose_step((), pixels=pixels, most=maps.MOST_SQUARES, uncertainty=None)
    if not levels:
        levels = _find_levels(found, maps.read_squares(found, window, polygon, step=max(coarse, 4))[0])
    step = asked.step or science.choose_step(
        levels, pixels=pixels, most=maps.MOST_SQUARES, uncertainty=found.uncertainty
    )
    if asked.step is not None and pixels / step**2 > maps.MOST_SQUARES:
        message = f"{pixels // step**2} squares are too many: take a step of {coarse} or more"
        raise wrong("query.step", message)
    while True:
        plane, squares = maps.read_squares(found, window, polygon, step=step)
        if min(plane.shape) < 2:
            message = f"the area holds fewer than 2 x 2 squares of {step} pixels: take a smaller step"
            raise wrong("query.step", message)
        lines = science.trace_isolines(plane, levels, step=step, left_px=window.col0, top_px=window.row0)
        vertices = sum(len(line) for each in lines for line in each.lines)
        is_last = bool(asked.step) or 2 * step > math.isqrt(pixels) // _FEWEST_SQUARES
        if vertices <= science.MOST_VERTICES and (
            is_last or not science.is_ragged(lines, found.uncertainty, step=step)
        ):
            break
        if asked.step is not None:
            message = f"the lines have {vertices} points: take a larger step, or fewer levels"
            raise wrong("query.step", message)
        step *= 2
    place = found.row.result.get("place", {})
    return IsolinesAnswer(
        type="FeatureCollection",
        coordinates_in=coordinates,
        area=area,
        step_px=step,
        tolerance_px=science.TOLERANCE * step,
        vertices=vertices,
        unknown_share=1.0 - float(np.isfinite(plane).sum()) / max(1, squares),
        place_u_m=math.hypot(place["u_corner_m"], place["residual_m"]) if coordinates == "wgs84" else None,
        notes=found.list_notes(),
        features=[_make_feature(found, each, step, coordinates) for each in lines],
    )


def _choose_coordinates(found: maps.OpenMap, asked: LevelsOfMap) -> Coordinates:
    is_placed = bool(found.row.result.get("place", {}).get("transform"))
    chosen = asked.coordinates or ("wgs84" if is_placed else "pixel")
    if chosen == "wgs84" and not is_placed:
        raise Problem(interface.NOT_FOUND, "This map has no place: its isolines have pixel coordinates.")
    if chosen == "road_m" and not found.row.parameters.get("lanes"):
        raise Problem(interface.NOT_FOUND, "This measurement has no lanes: take `pixel` coordinates.")
    return chosen


def _find_levels(found: maps.OpenMap, plane: maps.Values) -> list[float]:
    """Return round levels between the percentiles of what is distinguished from zero."""
    known = plane[np.isfinite(plane)]
    if found.is_light:
        limit = found.uncertainty.limit if found.uncertainty else 0.0
        known = known[known > max(limit, 0.0)]
    if not known.size:
        return []
    low, high = np.percentile(known, _LEVEL_ENDS)
    return list(science.choose_levels(float(low), float(high), logarithmic=found.is_light))


def _make_feature(
    found: maps.OpenMap, isoline: science.Isoline, step: int, coordinates: Coordinates
) -> IsolineFeature:
    known = found.uncertainty
    too_dark = bool(known and found.is_light and isoline.level < known.limit)
    properties = IsolineProperties.restate(
        isoline, unit=found.layout.unit, too_dark=too_dark, lines=len(isoline.lines)
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


def _place(found: maps.OpenMap, line: Array, coordinates: Coordinates) -> Array | None:
    if coordinates == "wgs84":
        # 1e-8 degrees are a millimetre
        return np.round(science.place_on_earth(found.row.result["place"]["transform"], line), 8)
    if coordinates == "road_m":
        placed = science.place_on_road(found.row.parameters["lanes"], line)
        return None if placed is None else np.round(placed, 4)
    return np.round(line, 2)


router = operations.Router(prefix="/v1/measurements/{measurement_id}", tags=["measurements"])


@router.get("/isolines.geojson", response_class=GeoJson, **answers.sends(IsolinesAnswer, 404, 500))
def get_measurement_isolines(
    measurement: lookup.Own[Measurement],
    request: Request,
    context: UsesContext,
    asked: Annotated[LevelsOfMap, Query()],
) -> Response:
    """Lines of equal value, a feature a level, traced in the map's means over squares of `step_px`.

    Rings around a single square are left out and counted. No line crosses a square with a saturated pixel.
    """
    with maps.open_map(context, measurement) as found:
        headers = answers.immutable(request, found.tag(f"{request.url.path}?{request.url.query}"))
        return GeoJson(answer_isolines(found, asked).dump(), headers=headers)
