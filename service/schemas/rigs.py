"""Rigs: cameras that are mounted together, and their orientation."""

from typing import Annotated, Any, get_args, get_type_hints

from pydantic import Field, model_validator

from radiometry.fleet.rigs import RigStability
from service.schemas.base import Answer, Form, Instant, Quantity, Text
from service.schemas.fleet import VersionLeftOut
from store.queries.rigs import SPEC
from store.tables import Rig

_PARTS = get_type_hints(SPEC.result)
MOST_CAMERAS = 20


class NewRig(Form):
    name: Text
    camera_ids: Annotated[
        list[Text],
        Field(min_length=2, max_length=MOST_CAMERAS, description="The reference camera first."),
    ]

    @model_validator(mode="after")
    def _each_once(self) -> "NewRig":
        if len(set(self.camera_ids)) < len(self.camera_ids):
            raise ValueError("camera_ids names a camera twice")
        return self


class RigAnswer(Answer, restates=Rig, fields="id name camera_ids created_at"):
    pass


class RelativePoseAnswer(Answer, restates=get_args(_PARTS["poses"])[0]):
    pass


class RigPointAnswer(Answer, restates=get_args(_PARTS["points"])[0]):
    pass


class OrientationAnswer(Answer, restates=SPEC.result):
    pass


class RigSetAnswer(Answer):
    """One set of pictures taken together, with the versions that it was made from."""

    at: Instant
    calibration_ids: list[str]
    orientation: OrientationAnswer


class RigStabilityAnswer(Answer, restates=RigStability):
    mean: Quantity


class RigOrientationAnswer(Answer):
    rig_id: str
    sets: list[RigSetAnswer] = Field(description="In time, the newest last.")
    stability: list[RigStabilityAnswer]
    left_out: list[VersionLeftOut]


class RigFile(Answer):
    """Cameras and orientation of a rig with their covariances."""

    rig: str
    reference: str
    convention: str
    cameras: list[dict[str, Any]]
    orientations: list[dict[str, Any]]
