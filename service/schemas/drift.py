"""One camera over time."""

from pydantic import Field

from radiometry.fleet.determinations import Determination, LeftOut, Source
from radiometry.fleet.drift import Drift
from service.schemas.base import Answer, Instant, Method
from service.schemas.fleet import Parameter, VersionLeftOut
from store.tables import Camera


class Determined(Answer, restates=(Determination, Source), fields="at value standard_uncertainty"):
    calibration_id: str

    @classmethod
    def of(cls, row: Determination) -> "Determined":
        return cls.restate(row, row.source, calibration_id=row.source.version)


class ParameterDrift(Parameter, restates=Drift, without="key"):
    determinations: list[Determined]

    @classmethod
    def of(cls, row: Drift) -> "ParameterDrift":
        return cls.restate(row, row.key, determinations=[Determined.of(each) for each in row.determinations])


class DriftAnswer(Answer):
    camera_id: str
    method: Method
    recalibrate_by: Instant | None = Field(default=None, description="The earliest of all parameters.")
    parameters: list[ParameterDrift]
    left_out: list[VersionLeftOut]

    @classmethod
    def of(
        cls, camera: Camera, method: Method, drifts: tuple[Drift, ...], left_out: tuple[LeftOut, ...]
    ) -> "DriftAnswer":
        return cls.restate(
            camera_id=camera.id,
            method=method,
            recalibrate_by=min((row.recalibrate_by for row in drifts if row.recalibrate_by), default=None),
            parameters=[ParameterDrift.of(row) for row in drifts],
            left_out=left_out,
        )
