"""Versions, publications, and the coefficients in force."""

from typing import Annotated, Any, Literal

from pydantic import AliasPath, Discriminator, Field, Tag

from radiometry.findings import Raised
from radiometry.fleet import determinations, results
from radiometry.fleet.results import Deviation, Effect, FleetVerdict, Outcome, ParameterVerdict
from radiometry.methods import get_method
from radiometry.specification.certificate import KeyFigure
from radiometry.specification.method import Scope
from service.http import models, problems
from service.http.models import Answer, Instant, maybe, told
from store.codec import drop_absent
from store.queries.calibrations import Lifetime, VersionStatus
from store.queries.organisations import Person
from store.tables import Calibration, CoefficientRow, IssuedCertificate, Publication

IN_FORCE = "in_force"
SCOPE_MEANING = (
    "`traceable`, or `relative_only`: the standard uncertainty lacks the error of the reference's scale, and "
    "holds for ratios alone. Absent where the method checks no certificate of a reference."
)


class PersonAnswer(Answer, restates=Person):
    """The person who fitted or approved, as the key states it."""


class NewPublication(models.Form):
    valid_from: Instant = told("Frames taken from then on are measured with this version.")
    valid_to: Instant | None = maybe("After `valid_from`; without it, until another version replaces it.")
    reason: models.Reason = told("Who reviewed the version, and on what grounds; on the record.")

    def check(self) -> None:
        if self.valid_to is not None and self.valid_to <= self.valid_from:
            raise ValueError("valid_to must lie after valid_from; validity is [valid_from, valid_to)")


class NewRevocation(models.Form):
    reason: models.Reason = told("What is wrong with the version; shown with every measurement made with it.")


class Coefficient(
    Answer,
    restates=CoefficientRow,
    fields="name value standard_uncertainty unit iso f_number band channel model flags",
):
    pass


class CoefficientInForce(Coefficient):
    effective_dof: float | None = maybe("Of the standard uncertainty; absent if without limit.")
    coverage_factor: float | None = maybe("For a coverage probability of 95 %.")
    expanded_uncertainty: float | None = maybe("`coverage_factor` u; absent of `relative_only`.")
    uncertainty_scope: Scope | None = maybe(SCOPE_MEANING)
    calibration_id: str
    version: int
    valid_from: Instant
    valid_to: Instant | None = None
    why: str


class CoefficientsAnswer(Answer):
    items: list[CoefficientInForce]


class Gap(Answer):
    """An item that ISO/IEC 17025 asks of a certificate and that this one lacks."""

    code: str
    message: str


class KeyFigureAnswer(Answer, restates=KeyFigure):
    """One of the few figures of a version that a person looks for first."""


class IssuedAnswer(
    Answer,
    restates=IssuedCertificate,
    fields="amendment number issued_at at_upgrade fitted_by approved_by json_sha256 pdf_sha256",
):
    """A certificate that was issued with a publication: the original, or an amendment beside it."""

    fitted_by: PersonAnswer | None = None
    approved_by: PersonAnswer | None = maybe("Absent: nobody has signed it.")
    reason: str = told("Of the publication.")


class SuggestedValidity(Answer):
    valid_from: Instant
    valid_to: Instant | None = maybe("Of a method whose coefficients hold for one flight.")


class CalibrationAnswer(
    Answer,
    restates=(Calibration, VersionStatus),
    fields="id camera_id campaign_id version state configuration software content_sha256 "
    "created_at created_by valid_from valid_to superseded_by revoked_reason",
):
    method: models.Method
    uncertainty_scope: Scope | None = maybe(SCOPE_MEANING)
    coefficients: list[Coefficient]
    key_figures: list[KeyFigureAnswer] | None = maybe(
        "What a person looks for first, as the method chooses; not in lists."
    )
    parameters: dict[str, Any]
    diagnostics: dict[str, Any] | None = None
    points: list[dict[str, Any]] | None = None
    findings: list[models.FindingGroupAnswer] | None = maybe(
        "The flags of `diagnostics`, equal ones as one; not in lists."
    )
    inputs: dict[str, Any] | None = None
    certificates: list[IssuedAnswer] | None = maybe("As they were issued, the original first; not in lists.")
    suggested_validity: SuggestedValidity | None = maybe(
        "Of a draft: in force from then on, its campaign's frames are measured with it."
    )
    warnings: list[Gap] | None = maybe("When it is published: what its certificate lacks.")

    @classmethod
    def of(
        cls, row: Calibration, status: VersionStatus, coefficients: list[CoefficientRow], *, whole: bool
    ) -> "CalibrationAnswer":
        """``whole``: with points, diagnostics and inputs, which a list leaves out."""
        parameters, spec = drop_absent(row.parameters), get_method(row.method)
        detail: dict[str, Any] = {"inputs": None}
        scope = next((s for each in coefficients if (s := spec.find_scope(each.name, each.flags))), None)
        if whole:
            result = drop_absent(row.result)
            figures = [KeyFigureAnswer.model_validate(each) for each in spec.list_key_figures(result)]
            if scope == "relative_only":
                untold = {"expanded_uncertainty": None, "coverage_factor": None}
                figures = [each.model_copy(update=untold) for each in figures]
            detail = {"key_figures": figures, "findings": models.group_flags(result.get("flags", []))}
            detail |= {"points": result.pop("points", []), "diagnostics": result}
        return cls.restate(
            row,
            status,
            parameters=parameters,
            coefficients=coefficients,
            uncertainty_scope=scope,
            **detail,
        )


class Period(Answer, restates=Publication, fields="valid_from valid_to"):
    """A time [valid_from, valid_to); open without its end."""


class LifetimeAnswer(Answer):
    """A published version, as known at a time."""

    calibration_id: str
    version: int
    created_at: Instant
    coefficients: list[Coefficient]
    in_force: list[Period]
    revoked_from: list[Period]
    published_at: list[Instant]
    published_by: str
    published_by_name: str | None = None
    reason: str
    revoked_at: Instant | None = None
    revoked_by: str | None = None
    revoked_by_name: str | None = None
    revoked_reason: str | None = None

    @classmethod
    def of(cls, row: Lifetime, names: dict[str, str]) -> "LifetimeAnswer":
        last, end = row.published[-1], row.revocation
        return cls.restate(
            row,
            row.calibration,
            last.publication,
            end,
            calibration_id=row.calibration.id,
            published_at=[act.publication.known_from for act in row.published],
            published_by=last.by,
            published_by_name=names.get(last.by),
            revoked_by_name=names.get(end.revoked_by) if end else None,
            revoked_reason=end.reason if end else None,
        )


class ValidityAnswer(Answer):
    """Every version of a method that had been published by `known_at`, newest first."""

    known_at: Instant
    items: list[LifetimeAnswer]


MOST_CAMERAS = 100

ASSUMED = (
    "Campaigns of one camera repeat its calibration; only what differs between them is repeatability.",
    "What all campaigns share, such as one meter's calibration, moves the mean and no verdict.",
    "What one camera's campaigns share among themselves alone is taken for a property of that camera.",
    "The repeatability is the same for all cameras, and nearly normal.",
)


Tolerance = Annotated[
    Annotated[models.Positive, Tag(problems.AS_NUMBER)]
    | Annotated[
        dict[models.Text, models.Positive],
        Field(min_length=1, max_length=100, json_schema_extra={"additionalProperties": False}),
        Tag(problems.BY_NAME),
    ],
    Discriminator(lambda value: problems.BY_NAME if isinstance(value, dict) else problems.AS_NUMBER),
]


class LensNamed(models.Form):
    """The lens that a version was made with, where neither its files nor its camera say so."""

    calibration_id: models.Text
    serial: models.Text


class NewFleetVerdict(models.Form):
    method: models.Method
    camera_ids: Annotated[models.CameraIds, Field(max_length=MOST_CAMERAS)]
    tolerance: Tolerance = told(
        "The largest accepted deviation from the shared value: one number in the method's "
        "unit (a share below 1 such as 0.04; of geometry px), or one for each parameter by name."
    )
    lenses: Annotated[list[LensNamed] | None, Field(max_length=1000)] = None


class FlagRaised(Answer, restates=Raised):
    pass


class VersionLeftOut(Answer, restates=determinations.LeftOut, without="version"):
    calibration_id: str = Field(validation_alias="version")


class ToleranceMeant(Answer, restates=results.Tolerance):
    """A tolerance as it was understood: a limit in the unit of the cost."""

    kind: Literal["relative", "absolute"]


class Parameter(Answer, restates=determinations.Key):
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
    within_camera_variance: models.Quantity | None = None
    between_camera_variance: models.Quantity | None = None
    equivalence_p_value: float | None = maybe("Small: every camera lies within the tolerance.")
    exceedance_p_value: float | None = maybe("Small: some camera lies outside the tolerance.")

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
    repeats: int = told("Campaigns with a published version that was not revoked.")


class FleetVerdictAnswer(Answer, restates=FleetVerdict, fields="said left_out"):
    method: models.Method
    verdict: Outcome
    cameras: list[FleetCamera]
    parameters: list[ParameterVerdictAnswer]
    assumed: list[str]
