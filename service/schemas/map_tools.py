"""Line profiles, isolines and histograms of a map."""

import math
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator
from radiometry.maps.histogram import AreaHistogram, Rank
from radiometry.maps.isolines import MOST_LEVELS, MOST_VERTICES
from radiometry.maps.profile import MOST_CORNERS, MOST_WIDTH_PX

from service.map_tools import Area, read_points
from service.schemas.base import Answer, Form, Quantity

MOST_POINTS = 10_000
_USUAL_POINTS = 1000
Gap = Literal["saturated", "no_value", "too_dark"]
Scale = Literal["road_m", "wgs84"]
Coordinates = Literal["pixel", "road_m", "wgs84"]


_NUMBER = r"[-+]?[0-9]+(\.[0-9]+)?([eE][-+]?[0-9]{1,2})?"
_CORNER = f"{_NUMBER},{_NUMBER}"
# schemas only: what is refused is refused by the checks, with their words
_LINE = {"pattern": f"^{_CORNER}( {_CORNER}){{1,{MOST_CORNERS - 1}}}$"}
_LEVELS = {"pattern": f"^{_NUMBER}(,{_NUMBER}){{0,{MOST_LEVELS - 1}}}$"}


def _check_points(text: str) -> str:
    points = read_points(text)
    if len(points) < 2 or not all(math.isfinite(value) for point in points for value in point):
        raise ValueError("must be two corners or more, each of two finite numbers")
    return text


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


class LineOfMap(Form):
    """A line in a map, and how finely it is read."""

    line: Annotated[
        str,
        AfterValidator(_check_points),
        Field(
            max_length=2000,
            description=f"Two to {MOST_CORNERS} corners: `x,y` pairs in pixels, separated by blanks. Pixel "
            "(row, col) has its centre at (col + 0.5, row + 0.5).",
            examples=["20.5,40.5 300.5,40.5"],
            json_schema_extra=_LINE,
        ),
    ]
    across_px: Annotated[
        int, Field(ge=1, le=MOST_WIDTH_PX, description="Pixels across the line, which are averaged.")
    ] = 1
    most: Annotated[
        int,
        Field(ge=2, le=MOST_POINTS, description="Largest number of points; pixels along are averaged to it."),
    ] = _USUAL_POINTS


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


class BinsOfMap(Form):
    """Area and axis of a histogram."""

    area: Annotated[Area, Field(description=_AREA)] = "region"
    axis: Annotated[
        Literal["logarithmic", "linear"] | None,
        Field(description="Left out: logarithmic of a luminance or radiance, else linear."),
    ] = None
    bins: Annotated[int, Field(ge=1, le=500)] = 60
    low: Annotated[float | None, Field(description="First edge. Left out: of the values.")] = None
    high: Annotated[float | None, Field(description="Last edge. Left out: of the values.")] = None

    @model_validator(mode="after")
    def _check_ends(self) -> Self:
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError("`low` must be below `high`")
        if self.axis == "logarithmic" and any(end is not None and end <= 0 for end in (self.low, self.high)):
            raise ValueError("edges of a logarithmic axis must be above zero")
        return self


class ProfilePoint(Answer):
    """A place on the line; without `value` where a pixel of its mean is unknown."""

    distance_px: float
    distance_m: float | None = Field(default=None, description="On the ground, where the map has a scale.")
    x_px: float
    y_px: float
    x_m: float | None = Field(default=None, description="Along the lanes, from the first marked corner.")
    y_m: float | None = Field(default=None, description="Across the lanes.")
    longitude_deg: float | None = None
    latitude_deg: float | None = None
    value: float | None = None
    standard_uncertainty: float | None = Field(default=None, description="Both parts together.")
    common_uncertainty: float | None = Field(
        default=None, description="Of what all pixels share, such as K: it shifts the whole profile."
    )
    own_uncertainty: float | None = Field(
        default=None,
        description="Upper bound of the noise of this point alone, which differs point by point.",
    )
    gap: Gap | None = Field(
        default=None,
        description="`saturated`, `no_value`; `too_dark`: the value is not distinguished from zero.",
    )


class ProfileAnswer(Answer):
    """Values of a map along a line."""

    unit: str
    across_px: int
    step_px: int = Field(description="Pixels along the line that are averaged to one point.")
    length_px: float
    length_m: float | None = None
    scale: Scale | None = Field(default=None, description="Source of the metres.")
    gaps: dict[Gap, int] = Field(description="Number of points of each kind of gap.")
    mean: Quantity | None = Field(default=None, description="Of the points with a value.")
    min: Quantity | None = Field(default=None, description="Smallest point: noise lowers it.")
    max: Quantity | None = Field(default=None, description="Largest point: noise raises it.")
    min_to_max: float | None = Field(
        default=None,
        description="Smallest over largest point: of a line along a lane, its longitudinal uniformity as "
        "seen from above. Noise lowers it.",
    )
    notes: list[str] = Field(description="What the uncertainty does not contain.")
    points: list[ProfilePoint]


class RankedValue(Answer):
    """A percentile of all pixels of the area."""

    percent: int
    rank: Rank = Field(
        description="`value`; `too_dark`: below `limit`; `unknown`: saturated, above every value."
    )
    value: float | None = None
    standard_uncertainty: float | None = Field(default=None, description="Of a single pixel.")


class Bin(Answer):
    """A bin, with its lower edge; the last bin holds its upper edge, too."""

    low: float
    high: float
    pixels: int
    share: float = Field(description="Of all pixels of the area.")


class HistogramAnswer(Answer):
    """Pixels of an area by their values. Bins, `below`, `above`, `too_dark` and `unknown` are all pixels."""

    unit: str
    area: Area
    axis: Literal["logarithmic", "linear"]
    pixels: int
    unknown: int = Field(description="Pixels without a value: saturated.")
    too_dark: int = Field(description="Pixels below `limit`, in no bin.")
    limit: float | None = Field(
        default=None,
        description="Below it a single pixel is not distinguished from zero (2 u). Absent of a ratio.",
    )
    below: int
    above: int
    mean: Quantity | None = Field(
        default=None, description="Of all pixels with a value; too low where pixels are saturated."
    )
    smallest: float | None = None
    largest: float | None = None
    percentiles: list[RankedValue]
    bins: list[Bin]
    notes: list[str] = Field(description="What the uncertainty does not contain.")


def list_bins(histogram: AreaHistogram) -> list[Bin]:
    return [
        Bin(low=low, high=high, pixels=count, share=count / histogram.pixels)
        for low, high, count in zip(
            histogram.edges[:-1].tolist(),
            histogram.edges[1:].tolist(),
            histogram.counts.tolist(),
            strict=True,
        )
    ]


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
