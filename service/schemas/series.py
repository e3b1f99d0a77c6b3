"""Series: flat rows, all in one answer, for a dashboard's panel."""

from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, create_model

from service.schemas.base import Answer, Instant
from store.ready.rows import COLUMNS, KINDS

_NULL: dict[str, Any] = {"nullable_on_purpose": True}
_Number = Annotated[float | None, Field(json_schema_extra=_NULL)]
_Word = Annotated[str | None, Field(json_schema_extra=_NULL)]


class SeriesRow(Answer):
    """One coefficient of one published version: flat, for a dashboard's panel. What it has not is null."""

    camera_id: str
    make: str
    model_name: str
    serial: str
    method: str
    version: int
    calibration_id: str
    name: str
    value: float
    standard_uncertainty: float
    unit: str
    iso: _Number = None
    f_number: _Number = None
    band: _Word = None
    channel: _Word = None
    model: str
    flags: str = Field(description="Codes, separated by spaces.")
    valid_from: Instant
    valid_to: Annotated[Instant | None, Field(json_schema_extra=_NULL)] = None
    campaign_id: str
    computed_at: Instant = Field(description="When the version was fitted.")


_NEXT = Field(default=None, description="Where the next rows are. Absent where none are left.")


class SeriesAnswer(Answer):
    rows: list[SeriesRow]
    next: str | None = _NEXT


_ALWAYS = frozenset(
    (
        *("id", "frame_id", "filename", "calibration_id", "calibration_version", "calibration_state"),
        *("region_origin", "frames", "vignetting", "signal", "flags", "created_at"),
        *("camera_id", "make", "model_name", "serial", "campaign_id", "method"),
    )
)
_NULLABLE = {float: _Number, str: _Word, int: Annotated[int | None, Field(json_schema_extra=_NULL)]}

if TYPE_CHECKING:
    MeasurementRow = dict[str, Any]
    MeasurementSeriesRow = dict[str, Any]
else:
    MeasurementRow = create_model(
        "MeasurementRow",
        __base__=Answer,
        __doc__="One measurement, flat; what it does not have is left out.",
        **{name: (KINDS.get(name, float) | None, None) for name in COLUMNS},
    )
    MeasurementSeriesRow = create_model(
        "MeasurementSeriesRow",
        __base__=Answer,
        __doc__="One measurement, flat, with every column; what it does not have is null.",
        **{
            name: (kind, ...) if name in _ALWAYS else (_NULLABLE[kind], None)
            for name in COLUMNS
            for kind in (KINDS.get(name, float),)
        }
        | {"created_at": (Instant, ...)},
    )


class MeasurementSeriesAnswer(Answer):
    """One row a measurement; the columns are those of measurements.csv."""

    rows: list[MeasurementSeriesRow]
    next: str | None = _NEXT


class PointAnswer(Answer):
    """A GeoJSON point: longitude, latitude and, where known, altitude [m]."""

    type: Literal["Point"]
    coordinates: list[float] = Field(min_length=2, max_length=3)


class FeatureAnswer(Answer):
    """A measurement as a GeoJSON feature; without geometry where the file names no place."""

    type: Literal["Feature"]
    id: str
    geometry: PointAnswer | None = Field(json_schema_extra={"nullable_on_purpose": True})
    properties: MeasurementRow


class FeaturesAnswer(Answer):
    """Measurements as a GeoJSON feature collection (RFC 7946)."""

    type: Literal["FeatureCollection"]
    features: list[FeatureAnswer]


class CellRow(Answer):
    """A cell of a surface: its luminance, and its centre in the frame and, of lanes, on the road."""

    row: int
    column: int
    luminance_cd_m2: float
    standard_uncertainty_cd_m2: float
    x_px: float
    y_px: float
    x_m: float | None = None
    y_m: float | None = None
    seen_from: Literal["above"]


class OutlineAnswer(Answer):
    type: Literal["Polygon"]
    coordinates: list[list[list[float]]]


class CellFeatureAnswer(Answer):
    type: Literal["Feature"]
    id: str
    geometry: OutlineAnswer
    properties: CellRow


class CellsAnswer(Answer):
    """Cells in the form of GeoJSON; their coordinates are not longitude and latitude."""

    type: Literal["FeatureCollection"]
    coordinates_in: Literal["pixel", "road_m"] = Field(
        description="`pixel`: x right, y down, of the frame. `road_m`: along and across the lanes from the "
        "first corner."
    )
    features: list[CellFeatureAnswer]
