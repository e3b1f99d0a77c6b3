"""Fits, versions, publications, and the coefficients in force."""

from typing import Any, Literal

from pydantic import Field, model_validator

from radiometry.methods import get_method
from radiometry.specification.certificate import KeyFigure
from radiometry.specification.method import Scope
from service.schemas.base import Answer, Form, Instant, LongText, Method
from service.schemas.findings import FindingGroupAnswer, group_flags
from store.codec import drop_absent
from store.queries.calibrations import VersionStatus
from store.queries.organisations import Person
from store.tables import Calibration, CoefficientRow, IssuedCertificate

IN_FORCE = "in_force"
SCOPE_MEANING = (
    "`traceable`, or `relative_only`: the standard uncertainty lacks the error of the reference's scale, and "
    "holds for ratios alone. Absent where the method checks no certificate of a reference."
)
State = Literal["draft", "published", "superseded", "revoked"]


class PersonAnswer(Answer, restates=Person):
    """The person who fitted or approved, as the key states it."""


class NewPublication(Form):
    valid_from: Instant = Field(description="Frames taken from then on are measured with this version.")
    valid_to: Instant | None = Field(
        default=None, description="After `valid_from`; without it, until another version replaces it."
    )
    reason: LongText = Field(description="Who reviewed the version, and on what grounds; on the record.")

    @model_validator(mode="after")
    def _in_order(self) -> "NewPublication":
        if self.valid_to is not None and self.valid_to <= self.valid_from:
            raise ValueError("valid_to must lie after valid_from; validity is [valid_from, valid_to)")
        return self


class NewRevocation(Form):
    reason: LongText = Field(
        description="What is wrong with the version; shown with every measurement made with it."
    )


class Coefficient(
    Answer,
    restates=CoefficientRow,
    fields="name value standard_uncertainty unit iso f_number band channel model flags",
):
    pass


class CoefficientInForce(Coefficient):
    uncertainty_scope: Scope | None = Field(default=None, description=SCOPE_MEANING)
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
    approved_by: PersonAnswer | None = Field(default=None, description="Absent: nobody has signed it.")
    reason: str = Field(description="Of the publication.")


class SuggestedValidity(Answer):
    valid_from: Instant
    valid_to: Instant | None = Field(
        default=None, description="Of a method whose coefficients hold for one flight."
    )


class CalibrationAnswer(
    Answer,
    restates=(Calibration, VersionStatus),
    fields="id camera_id campaign_id version state configuration software content_sha256 "
    "created_at created_by valid_from valid_to superseded_by revoked_reason",
):
    method: Method
    uncertainty_scope: Scope | None = Field(default=None, description=SCOPE_MEANING)
    coefficients: list[Coefficient]
    key_figures: list[KeyFigureAnswer] | None = Field(
        default=None, description="What a person looks for first, as the method chooses; not in lists."
    )
    parameters: dict[str, Any]
    diagnostics: dict[str, Any] | None = None
    points: list[dict[str, Any]] | None = None
    findings: list[FindingGroupAnswer] | None = Field(
        default=None, description="The flags of `diagnostics`, equal ones as one; not in lists."
    )
    inputs: dict[str, Any] | None = None
    certificates: list[IssuedAnswer] | None = Field(
        default=None, description="As they were issued, the original first; not in lists."
    )
    suggested_validity: SuggestedValidity | None = Field(
        default=None,
        description="Of a draft: in force from then on, its campaign's frames are measured with it.",
    )
    warnings: list[Gap] | None = Field(
        default=None, description="When it is published: what its certificate lacks."
    )

    @classmethod
    def of(
        cls, row: Calibration, status: VersionStatus, coefficients: list[CoefficientRow], *, whole: bool
    ) -> "CalibrationAnswer":
        """``whole``: with points, diagnostics and inputs, which a list leaves out."""
        parameters, spec = drop_absent(row.parameters), get_method(row.method)
        detail: dict[str, Any] = {"inputs": None}
        if whole:
            result = drop_absent(row.result)
            shown = [KeyFigureAnswer.model_validate(each) for each in spec.list_key_figures(result)]
            detail = {"key_figures": shown, "findings": group_flags(result.get("flags", []))}
            detail |= {"points": result.pop("points", []), "diagnostics": result}
        scopes = [scope for each in coefficients if (scope := spec.find_scope(each.name, each.flags))]
        return cls.restate(
            row,
            status,
            parameters=parameters,
            coefficients=coefficients,
            uncertainty_scope=scopes[0] if scopes else None,
            **detail,
        )
