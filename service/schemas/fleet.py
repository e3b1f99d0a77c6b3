"""One set of coefficients for several cameras, and one camera over time."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Discriminator, Field, Tag, model_validator

from radiometry.fleet.determinations import Determination, Key, LeftOut
from radiometry.fleet.results import Effect, FleetVerdict, ParameterVerdict
from radiometry.fleet.verdicts import Outcome
from service.schemas.base import Answer, Form, Method, Positive, Quantity, Text
from service.wording import AS_NUMBER, BY_NAME
from store.tables import Camera

MOST_CAMERAS = 100

ASSUMED = (
    "Campaigns of one camera repeat its calibration; only what differs between them is repeatability.",
    "What all campaigns share, such as one meter's calibration, moves the mean and no verdict.",
    "What one camera's campaigns share among themselves alone is taken for a property of that camera.",
    "The repeatability is the same for all cameras, and nearly normal.",
)

PARAMETER_EXAMPLE: dict[str, Any] = {
    "name": "luminance_k",
    "unit": "DN*m2/(cd*s)",
    "iso": 3200,
    "model": "proportional",
}
_EXAMPLE: dict[str, Any] = {
    "method": "luminance",
    "verdict": "shared",
    "said": "One set of coefficients serves all 2 cameras.",
    "cameras": [
        {"camera_id": "cam_1", "serial": "0K1XE8", "repeats": 3},
        {"camera_id": "cam_2", "serial": "0K1XF2", "repeats": 3},
    ],
    "parameters": [
        {
            **PARAMETER_EXAMPLE,
            "verdict": "shared",
            "judged": True,
            "said": "luminance_k at ISO 3200: one set serves all 2 cameras.",
            "cameras": 2,
            "repeats": 6,
            "mean": {"value": 33.1, "standard_uncertainty": 0.1, "unit": "DN*m2/(cd*s)"},
            "dof": 4,
            "tolerance": {"limit": 4, "unit": "%", "kind": "relative", "of": "of the luminance"},
            "cost": {"value": 0.6, "standard_uncertainty": 0.4, "unit": "%"},
            "costliest": "0K1XE8",
            "cameras_without": [],
            "effects": [],
            "flags": [],
        }
    ],
    "left_out": [],
    "assumed": [ASSUMED[0]],
}


def _form_of_tolerance(value: Any) -> str:  # noqa: ANN401
    return BY_NAME if isinstance(value, dict) else AS_NUMBER


Tolerance = Annotated[
    Annotated[Positive, Tag(AS_NUMBER)]
    | Annotated[dict[Text, Positive], Field(min_length=1, max_length=100), Tag(BY_NAME)],
    Discriminator(_form_of_tolerance),
]


class LensNamed(Form):
    """The lens that a version was made with, where neither its files nor its camera say so."""

    calibration_id: Text
    serial: Text


class NewFleetVerdict(Form):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"method": "luminance", "camera_ids": ["cam_1", "cam_2"], "tolerance": 0.04}]
        }
    )

    method: Method
    camera_ids: Annotated[list[Text], Field(min_length=2, max_length=MOST_CAMERAS)]
    tolerance: Annotated[
        Tolerance,
        Field(
            description="The largest accepted deviation from the shared value: one number in the method's "
            "unit (a share such as 0.04; of geometry px), or one for each parameter by name."
        ),
    ]
    lenses: Annotated[list[LensNamed] | None, Field(max_length=1000)] = None

    @model_validator(mode="after")
    def _each_once(self) -> "NewFleetVerdict":
        if len(set(self.camera_ids)) < len(self.camera_ids):
            raise ValueError("camera_ids names a camera twice")
        return self


class FlagRaised(Answer):
    flag: str
    where: str
    detail: str


class VersionLeftOut(Answer):
    calibration_id: str
    why: str

    @classmethod
    def of(cls, left_out: LeftOut) -> "VersionLeftOut":
        return cls(calibration_id=left_out.version, why=left_out.why)


class ToleranceMeant(Answer):
    """A tolerance as it was understood: a limit in the unit of the cost."""

    limit: float
    unit: str
    kind: Literal["relative", "absolute"]
    of: str


class Parameter(Answer):
    """What a coefficient is, without its value."""

    name: str
    unit: str
    iso: float | None = None
    f_number: float | None = None
    band: str | None = None
    channel: str | None = None
    model: str

    @staticmethod
    def columns(key: Key) -> dict[str, Any]:
        return {name: getattr(key, name) for name in Parameter.model_fields}


class LevelDeviation(Answer):
    label: str
    repeats: int
    deviation: Quantity
    cost: Quantity | None = None


class EffectAnswer(Answer):
    """Cameras; or bodies and lenses, where swaps tell them apart."""

    factor: Literal["camera", "body", "lens"]
    verdict: Outcome | None = None
    between_variance: Quantity
    dof: int
    f_statistic: float | None = None
    f_p_value: float | None = None
    deviations: list[LevelDeviation]

    @classmethod
    def of(cls, effect: Effect) -> "EffectAnswer":
        outcome = effect.judgement.outcome if effect.judgement else None
        return cls.model_validate({**vars(effect), "verdict": outcome})


class ParameterVerdictAnswer(Parameter):
    verdict: Outcome
    judged: bool = Field(
        description="False: no tolerance was given for it, and the fleet's verdict ignores it."
    )
    said: str
    cameras: int
    repeats: int
    mean: Quantity
    within_camera_variance: Quantity | None = None
    between_camera_variance: Quantity | None = None
    dof: int = Field(description="Degrees of freedom of the repeatability.")
    f_statistic: float | None = None
    f_p_value: float | None = None
    equivalence_p_value: float | None = Field(
        default=None, description="Small: every camera lies within the tolerance."
    )
    exceedance_p_value: float | None = Field(
        default=None, description="Small: some camera lies outside the tolerance."
    )
    tolerance: ToleranceMeant | None = None
    repeatability: Quantity | None = Field(default=None, description="Of one determination, as it is felt.")
    cost: Quantity | None = Field(default=None, description="The largest cost of sharing for a camera.")
    costliest: str | None = None
    repeats_needed: int | None = None
    cameras_without: list[str]
    effects: list[EffectAnswer]
    flags: list[FlagRaised]

    @classmethod
    def of(cls, row: ParameterVerdict) -> "ParameterVerdictAnswer":
        tests = row.judgement
        return cls.model_validate(
            {
                **vars(row),
                **Parameter.columns(row.key),
                "verdict": row.outcome,
                "within_camera_variance": row.within_variance,
                "between_camera_variance": row.between_variance,
                "equivalence_p_value": tests.equivalence_p_value if tests else None,
                "exceedance_p_value": tests.exceedance_p_value if tests else None,
                "effects": [EffectAnswer.of(effect) for effect in row.effects],
            }
        )


class FleetCamera(Answer):
    camera_id: str
    serial: str
    repeats: int = Field(description="Campaigns with a published version that was not revoked.")


class FleetVerdictAnswer(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})

    method: Method
    verdict: Outcome
    said: str
    cameras: list[FleetCamera]
    parameters: list[ParameterVerdictAnswer]
    left_out: list[VersionLeftOut]
    assumed: list[str]

    @classmethod
    def of(
        cls, method: Method, cameras: list[Camera], determinations: list[Determination], found: FleetVerdict
    ) -> "FleetVerdictAnswer":
        campaigns = {(row.source.camera, row.source.campaign) for row in determinations}
        return cls(
            method=method,
            verdict=found.outcome,
            said=found.said,
            cameras=[
                FleetCamera(
                    camera_id=camera.id,
                    serial=camera.serial,
                    repeats=sum(serial == camera.serial for serial, _ in campaigns),
                )
                for camera in cameras
            ],
            parameters=[ParameterVerdictAnswer.of(row) for row in found.parameters],
            left_out=[VersionLeftOut.of(row) for row in found.left_out],
            assumed=list(ASSUMED),
        )
