"""One set of coefficients for several cameras, and one camera over time."""

from typing import Annotated, Any, Literal

from pydantic import AliasPath, Discriminator, Field, Tag, model_validator

from radiometry.findings import Raised
from radiometry.fleet import results
from radiometry.fleet.determinations import Determination, Key, LeftOut
from radiometry.fleet.results import Deviation, Effect, FleetVerdict, Outcome, ParameterVerdict
from service.messages import AS_NUMBER, BY_NAME
from service.schemas.base import EACH_ONCE, Answer, Form, Method, Positive, Quantity, Text
from store.tables import Camera

MOST_CAMERAS = 100

ASSUMED = (
    "Campaigns of one camera repeat its calibration; only what differs between them is repeatability.",
    "What all campaigns share, such as one meter's calibration, moves the mean and no verdict.",
    "What one camera's campaigns share among themselves alone is taken for a property of that camera.",
    "The repeatability is the same for all cameras, and nearly normal.",
)


def _form_of_tolerance(value: Any) -> str:  # noqa: ANN401
    return BY_NAME if isinstance(value, dict) else AS_NUMBER


Tolerance = Annotated[
    Annotated[Positive, Tag(AS_NUMBER)]
    | Annotated[
        dict[Text, Positive],
        Field(min_length=1, max_length=100, json_schema_extra={"additionalProperties": False}),
        Tag(BY_NAME),
    ],
    Discriminator(_form_of_tolerance),
]


class LensNamed(Form):
    """The lens that a version was made with, where neither its files nor its camera say so."""

    calibration_id: Text
    serial: Text


class NewFleetVerdict(Form):
    method: Method
    camera_ids: Annotated[
        list[Text], Field(min_length=2, max_length=MOST_CAMERAS, json_schema_extra=EACH_ONCE)
    ]
    tolerance: Annotated[
        Tolerance,
        Field(
            description="The largest accepted deviation from the shared value: one number in the method's "
            "unit (a share below 1 such as 0.04; of geometry px), or one for each parameter by name."
        ),
    ]
    lenses: Annotated[list[LensNamed] | None, Field(max_length=1000)] = None

    @model_validator(mode="after")
    def _each_once(self) -> "NewFleetVerdict":
        if len(set(self.camera_ids)) < len(self.camera_ids):
            raise ValueError("camera_ids names a camera twice")
        return self


class FlagRaised(Answer, restates=Raised):
    pass


class VersionLeftOut(Answer, restates=LeftOut, without="version"):
    calibration_id: str = Field(validation_alias="version")


class ToleranceMeant(Answer, restates=results.Tolerance):
    """A tolerance as it was understood: a limit in the unit of the cost."""

    kind: Literal["relative", "absolute"]


class Parameter(Answer, restates=Key):
    """Identity of a coefficient, without its value."""


class LevelDeviation(Answer, restates=Deviation):
    pass


class EffectAnswer(Answer, restates=Effect, without="judgement"):
    """Cameras; or bodies and lenses, where swaps tell them apart."""

    verdict: Outcome | None = Field(default=None, validation_alias=AliasPath("judgement", "outcome"))


class ParameterVerdictAnswer(
    Parameter, restates=ParameterVerdict, without="key outcome within_variance between_variance judgement"
):
    verdict: Outcome
    within_camera_variance: Quantity | None = None
    between_camera_variance: Quantity | None = None
    equivalence_p_value: float | None = Field(
        default=None, description="Small: every camera lies within the tolerance."
    )
    exceedance_p_value: float | None = Field(
        default=None, description="Small: some camera lies outside the tolerance."
    )

    @classmethod
    def of(cls, row: ParameterVerdict) -> "ParameterVerdictAnswer":
        return cls.restate(
            row,
            row.key,
            row.judgement,
            verdict=row.outcome,
            within_camera_variance=row.within_variance,
            between_camera_variance=row.between_variance,
        )


class FleetCamera(Answer):
    camera_id: str
    serial: str
    repeats: int = Field(description="Campaigns with a published version that was not revoked.")


class FleetVerdictAnswer(Answer, restates=FleetVerdict, fields="said left_out"):
    method: Method
    verdict: Outcome
    cameras: list[FleetCamera]
    parameters: list[ParameterVerdictAnswer]
    assumed: list[str]

    @classmethod
    def of(
        cls, method: Method, cameras: list[Camera], determinations: list[Determination], found: FleetVerdict
    ) -> "FleetVerdictAnswer":
        campaigns = {(row.source.camera, row.source.campaign) for row in determinations}
        return cls.restate(
            found,
            method=method,
            verdict=found.outcome,
            cameras=[
                FleetCamera(
                    camera_id=camera.id,
                    serial=camera.serial,
                    repeats=sum(serial == camera.serial for serial, _ in campaigns),
                )
                for camera in cameras
            ],
            parameters=[ParameterVerdictAnswer.of(row) for row in found.parameters],
            assumed=ASSUMED,
        )
