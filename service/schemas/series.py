"""Series: flat rows, all in one answer, for a dashboard's panel."""

from typing import Any

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


class MeasurementSeriesAnswer(Answer):
    """One row a measurement; the columns are those of measurements.csv."""

    rows: list[dict[str, Any]]
