"""One camera over time."""

from typing import Any

from pydantic import ConfigDict, Field

from radiometry.fleet.determinations import Determination, LeftOut
from radiometry.fleet.drift import Drift
from service.schemas.base import Answer, Instant, Method, Quantity
from service.schemas.fleet import PARAMETER_EXAMPLE, Parameter, ToleranceMeant, VersionLeftOut
from store.tables import Camera

_EXAMPLE: dict[str, Any] = {
    "camera_id": "cam_1",
    "method": "luminance",
    "recalibrate_by": "2027-03-01T08:00:00Z",
    "parameters": [
        {
            **PARAMETER_EXAMPLE,
            "determinations": [
                {
                    "calibration_id": "cal_1",
                    "at": "2026-05-01T08:00:00Z",
                    "value": 33.1,
                    "standard_uncertainty": 0.4,
                }
            ],
            "recalibrate_by": "2027-03-01T08:00:00Z",
        }
    ],
    "left_out": [],
}


class Determined(Answer):
    calibration_id: str
    at: Instant
    value: float
    standard_uncertainty: float

    @classmethod
    def of(cls, row: Determination) -> "Determined":
        return cls(
            calibration_id=row.source.version,
            at=row.source.at,
            value=row.value,
            standard_uncertainty=row.standard_uncertainty,
        )


class ParameterDrift(Parameter):
    determinations: list[Determined]
    slope: Quantity | None = None
    slope_interval: list[float] | None = Field(default=None, description="For 95 %, in the slope's unit.")
    slope_p_value: float | None = Field(default=None, description="Small: it drifts.")
    cost_per_year: Quantity | None = None
    scatter: Quantity | None = Field(default=None, description="Of one determination about the line.")
    tolerance: ToleranceMeant | None = None
    recalibrate_by: Instant | None = None
    why: str | None = Field(default=None, description="Why there is no date.")

    @classmethod
    def of(cls, row: Drift) -> "ParameterDrift":
        return cls.model_validate(
            {
                **vars(row),
                **Parameter.columns(row.key),
                "determinations": [Determined.of(each) for each in row.determinations],
            }
        )


class DriftAnswer(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})

    camera_id: str
    method: Method
    recalibrate_by: Instant | None = Field(default=None, description="The earliest of all parameters.")
    parameters: list[ParameterDrift]
    left_out: list[VersionLeftOut]

    @classmethod
    def of(
        cls, camera: Camera, method: Method, drifts: tuple[Drift, ...], left_out: tuple[LeftOut, ...]
    ) -> "DriftAnswer":
        return cls(
            camera_id=camera.id,
            method=method,
            recalibrate_by=min((row.recalibrate_by for row in drifts if row.recalibrate_by), default=None),
            parameters=[ParameterDrift.of(row) for row in drifts],
            left_out=[VersionLeftOut.of(row) for row in left_out],
        )
