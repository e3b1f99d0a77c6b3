"""Series: flat rows, all in one answer, for a dashboard's panel."""

from typing import Any

from pydantic import ConfigDict

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
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "rows": [
                        {
                            "camera_id": "cam_1",
                            "make": "DJI",
                            "model_name": "FC6520",
                            "serial": "0K1XE8",
                            "method": "luminance",
                            "version": 1,
                            "calibration_id": "cal_1",
                            "name": "luminance_k",
                            "value": 33.1,
                            "standard_uncertainty": 0.4,
                            "unit": "DN*m2/(cd*s)",
                            "iso": 3200,
                            "model": "proportional",
                            "flags": "",
                            "valid_from": "2026-05-01T00:00:00Z",
                        }
                    ]
                }
            ]
        }
    )

    rows: list[SeriesRow]


class MeasurementSeriesAnswer(Answer):
    """One row a measurement; the columns are those of measurements.csv."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "rows": [
                        {
                            "id": "msr_1",
                            "filename": "DJI_0100.DNG",
                            "calibration_version": 3,
                            "mean_cd_m2": 0.787,
                            "mean_cd_m2_standard_uncertainty": 0.028,
                            "created_at": "2026-05-03T08:00:00Z",
                        }
                    ]
                }
            ]
        }
    )

    rows: list[dict[str, Any]]
