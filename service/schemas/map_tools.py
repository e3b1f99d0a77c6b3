"""Isolines of a map."""

import math
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from radiometry.maps import MOST_LEVELS, MOST_VERTICES
from service.map_tools import Area
from service.schemas.base import Answer, Form

Coordinates = Literal["pixel", "road_m", "wgs84"]


_NUMBER = r"[-+]?[0-9]+(\.[0-9]+)?([eE][-+]?[0-9]{1,2})?"
# schemas only: what is refused is refused by the checks, with their words
_LEVELS = {"pattern": f"^{_NUMBER}(,{_NUMBER}){{0,{MOST_LEVELS - 1}}}$"}


def _check_levels(text: str) -> str:
    try:
        levels = [float(level) for level in text.replace(",", " ").split()]
    except ValueError:
        levels = []
    if not 1 <= len(levels) <= MOST_LEVELS or not all(map(math.isfinite, levels)):
        raise ValueError(f"must be 1 to {MOST_LEVELS} finite numbers with commas between, as in `0.5,1,2`")
    return text


_AREA = (
    "`region`: that of the measurement. `grid`: the outline of its cells. `frame`: the whole map, lamps and "
    "sky included."
)


class LevelsOfMap(Form):
    """Levels of isolines, and the area in which they are traced."""

    levels: Annotated[
        str | None,
        AfterValidator(_check_levels),
        Field(
            max_length=500,
            description=f"1 to {MOST_LEVELS} values in the map's unit, separated by commas. Left out: round "
            "ones between the 1st and the 99th percentile of the area.",
            examples=["0.5,1,2"],
            json_schema_extra=_LEVELS,
        ),
    ] = None
    area: Annotated[Area, Field(description=_AREA)] = "frame"
    step: Annotated[
        int | None,
        Field(
            ge=1,
            le=1024,
            description="Side of the squares over which the map is averaged first [px]. Left out: as small "
            "as noise between neighbouring levels allows.",
        ),
    ] = None
    coordinates: Annotated[
        Coordinates | None,
        Field(
            description="`pixel`: x right, y down. `road_m`: along and across the lanes, inside the grid "
            "only. `wgs84`: longitude and latitude. Left out: `wgs84` where the map has a place, else "
            "`pixel`."
        ),
    ] = None

    def read_levels(self) -> list[float]:
        return sorted({float(level) for level in (self.levels or "").replace(",", " ").split()})


class IsolineGeometry(Answer):
    type: Literal["MultiLineString"]
    coordinates: list[list[list[float]]]


class IsolineProperties(Answer):
    level: float
    unit: str
    standard_uncertainty: float | None = Field(
        default=None,
        description="Of the level, from what all pixels share: it moves all lines of it together.",
    )
    own_uncertainty: float | None = Field(
        default=None, description="Upper bound of the noise of one square's mean: it ruffles the lines."
    )
    place_u_px: float | None = Field(
        default=None, description="Both uncertainties together, over the median slope across the lines."
    )
    too_dark: bool = Field(description="True if the level is not distinguished from zero.")
    lines: int
    rings_left_out: int = Field(description="Rings around a single square, which noise alone draws.")


class IsolineFeature(Answer):
    type: Literal["Feature"]
    id: str
    geometry: IsolineGeometry
    properties: IsolineProperties


class IsolinesAnswer(Answer):
    """Isolines in the form of GeoJSON, longitude and latitude only with `coordinates_in` `wgs84`."""

    type: Literal["FeatureCollection"]
    coordinates_in: Coordinates
    area: Area
    step_px: int = Field(description="Side of the squares [px] that are averaged: finer detail is not drawn.")
    tolerance_px: float = Field(description="How far lines are moved where points are left out of them.")
    vertices: int = Field(description=f"Of all lines; at most {MOST_VERTICES}.")
    unknown_share: float = Field(
        description="Squares of the area with a saturated pixel; no line crosses them."
    )
    place_u_m: float | None = Field(
        default=None, description="Of `wgs84`: largest, with that of the transformation."
    )
    notes: list[str] = Field(description="What the uncertainty does not contain.")
    features: list[IsolineFeature]
