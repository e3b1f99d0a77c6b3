"""Requests and answers of recalls."""

from typing import Literal

from pydantic import ConfigDict, Field, model_validator

from service.schemas.base import Answer, Form, LongText, Text
from service.schemas.calibrations import State
from service.schemas.history import TouchedMeasurement
from store.impact import Condemned
from store.queries.calibrations import VersionStatus
from store.tables import Calibration, Recall

_CAUSES = ("meter_id", "meter_certificate_number", "software", "recorder")


class NewCause(Form):
    """The cause of a recall: exactly one of these fields."""

    model_config = ConfigDict(json_schema_extra={"oneOf": [{"required": [name]} for name in _CAUSES]})

    meter_id: Text | None = None
    meter_certificate_number: Text | None = Field(
        default=None, description="The certificate number when a version was made."
    )
    software: Text | None = Field(
        default=None, description="The fit code version, `software.stilb` of a version."
    )
    recorder: Text | None = Field(default=None, description="Recorder of the campaign, now or before.")

    @model_validator(mode="after")
    def _exactly_one(self) -> "NewCause":
        if len(self.named()) != 1:
            raise ValueError(f"give exactly one of {', '.join(_CAUSES)}")
        return self

    def named(self) -> dict[str, str]:
        """The one cause, as it is kept."""
        return self.model_dump(exclude_none=True)


class NewPurge(Form):
    cause: NewCause
    reason: LongText


class CondemnedVersion(
    Answer, restates=(Calibration, VersionStatus), fields="camera_id method version valid_from valid_to"
):
    calibration_id: str
    camera: str = Field(description="Make, model and serial number.")
    state: State
    in_force: bool = Field(
        description="Whether it is in force for any time, as known now: `valid_from` to `valid_to`."
    )
    measurements: list[TouchedMeasurement] = Field(
        description="Made with it. The successor of each is a version that the recall does not revoke."
    )

    @classmethod
    def of(cls, row: Condemned) -> "CondemnedVersion":
        camera = row.camera
        return cls.restate(
            row.calibration,
            row.status,
            calibration_id=row.calibration.id,
            camera=f"{camera.make} {camera.model} {camera.serial}",
            in_force=row.status.valid_from is not None,
            measurements=[TouchedMeasurement.of(each) for each in row.measurements],
        )


class PurgeAnswer(
    Answer,
    restates=Recall,
    fields="id cause reason calibration_ids created_by created_at confirmed_by confirmed_at",
):
    state: Literal["proposed", "confirmed"]
    cause: dict[str, str]
    calibration_ids: list[str] = Field(description="The versions under review, which confirming revokes.")
    versions: list[CondemnedVersion] | None = Field(
        default=None, description="Their current status. Absent in a list."
    )

    @classmethod
    def of(cls, row: Recall, condemned: list[Condemned] | None = None) -> "PurgeAnswer":
        versions = None if condemned is None else [CondemnedVersion.of(each) for each in condemned]
        return cls.restate(row, state="confirmed" if row.confirmed_at else "proposed", versions=versions)
