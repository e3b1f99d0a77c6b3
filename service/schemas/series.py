"""Series: flat rows, all in one answer, for a dashboard's panel."""

from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, create_model

from service.measurement_rows import COLUMNS, KINDS
from service.schemas.base import Answer, Instant


class SeriesRow(Answer):
    """One coefficient of one published version: flat, for a dashboard's panel."""

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
    iso: float | None = None
    f_number: float | None = None
    band: str | None = None
    channel: str | None = None
    model: str
    flags: str
    valid_from: Instant
    valid_to: Instant | None = None


class SeriesAnswer(Answer):
    rows: list[SeriesRow]


if TYPE_CHECKING:
    MeasurementRow = dict[str, Any]
else:
    MeasurementRow = create_model(
        "MeasurementRow",
        __base__=Answer,
        __doc__="One measurement, flat; what it does not have is left out.",
        **{name: (KINDS.get(name, float) | None, None) for name in COLUMNS},
    )


class MeasurementSeriesAnswer(Answer):
    """One row a measurement; the columns are those of measurements.csv."""

    rows: list[MeasurementRow]


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
