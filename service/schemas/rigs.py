"""Rigs: cameras that are mounted together, and their orientation."""

from typing import Annotated, Any, get_args, get_type_hints

from pydantic import Field, model_validator

from radiometry.fitting import evidence
from radiometry.fleet.drift import RigStability
from service.schemas.base import EACH_ONCE, Answer, Form, Instant, Quantity, Text
from service.schemas.calibrations import Gap
from service.schemas.certificates import FlagInWords, Item, Laboratory, Work
from service.schemas.findings import FindingGroupAnswer
from service.schemas.fleet import VersionLeftOut
from store.queries.fleet import SPEC
from store.tables import Rig

_PARTS = get_type_hints(SPEC.result)
MOST_CAMERAS = 20


class NewRig(Form):
    name: Text = Field(description="Under which the rig is found again; its exports carry it.")
    camera_ids: Annotated[
        list[Text],
        Field(
            min_length=2,
            max_length=MOST_CAMERAS,
            description="The reference camera first.",
            json_schema_extra=EACH_ONCE,
        ),
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
    findings: list[FindingGroupAnswer] = Field(description="Its flags, equal ones as one.")


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


class CertifiedCamera(Answer):
    """The version of a camera that the orientation takes as it is, with the number of its certificate."""

    item: Item
    certificate: str
    calibration_id: str
    version: int
    content_sha256: str
    state: str


class CertifiedPose(Answer, restates=evidence.Quantity, fields="value standard_uncertainty unit"):
    """A quantity of a camera's orientation with its expanded uncertainty U = k u."""

    camera: str
    name: str
    expanded_uncertainty: float
    coverage_factor: float
    effective_dof: float


class RigCertificateAnswer(Answer):
    """The orientation of a rig from one set, as it is handed out."""

    schema_version: int
    title: str
    number: str
    rig_id: str
    rig: str
    content_sha256: str = Field(description="Of the cameras' versions and the orientation.")
    procedure: str
    equation: str
    laboratory: Laboratory
    work: Work = Field(description="The reference's campaign.")
    cameras: list[CertifiedCamera] = Field(description="The reference first.")
    state: str = Field(description="The worst of the cameras' versions.")
    traceability: str
    at: Instant
    orientation: OrientationAnswer
    coefficients: list[CertifiedPose]
    stability: list[RigStabilityAnswer]
    flags: list[FlagInWords]
    software: dict[str, Any]
    created_at: Instant = Field(description="Of the newest version that it was made from.")
    statements: list[str]
    gaps: list[Gap] = Field(description="What ISO/IEC 17025, 7.8, asks for and a camera's certificate lacks.")
