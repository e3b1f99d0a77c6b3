"""Fits, versions, publications, and the coefficients in force."""

from typing import Any, Literal

from pydantic import ConfigDict, Field, model_validator

from service.schemas.base import Answer, Form, Instant, LongText
from store.codec import drop_absent
from store.queries.calibrations import VersionStatus
from store.tables import Calibration, CoefficientRow

IN_FORCE = "in_force"
State = Literal["draft", "published", "superseded", "revoked"]


class NewPublication(Form):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"valid_from": "2026-05-01T00:00:00Z", "reason": "spring calibration, reviewed by A. Meier"}
            ]
        }
    )

    valid_from: Instant
    valid_to: Instant | None = None
    reason: LongText

    @model_validator(mode="after")
    def _in_order(self) -> "NewPublication":
        if self.valid_to is not None and self.valid_to <= self.valid_from:
            raise ValueError("valid_to must lie after valid_from; validity is [valid_from, valid_to)")
        return self


class NewRevocation(Form):
    model_config = ConfigDict(
        json_schema_extra={"examples": [{"reason": "the meter was out of calibration"}]}
    )

    reason: LongText


class Coefficient(Answer):
    name: str
    value: float
    standard_uncertainty: float
    unit: str
    iso: float | None = None
    f_number: float | None = None
    band: str | None = None
    channel: str | None = None
    model: str
    flags: list[str]

    @classmethod
    def of(cls, row: CoefficientRow) -> "Coefficient":
        return cls.model_validate(row)


class CoefficientInForce(Coefficient):
    calibration_id: str
    version: int
    valid_from: Instant
    valid_to: Instant | None = None
    why: str


class CoefficientsAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "items": [
                        {
                            "name": "luminance_k",
                            "value": 33.1,
                            "standard_uncertainty": 0.4,
                            "unit": "DN*m2/(cd*s)",
                            "iso": 3200,
                            "model": "proportional",
                            "flags": [],
                            "calibration_id": "cal_1",
                            "version": 1,
                            "valid_from": "2026-05-01T00:00:00Z",
                            "why": "version 1 is in force from 2026-05-01T00:00:00Z on",
                        }
                    ]
                }
            ]
        }
    )

    items: list[CoefficientInForce]


class Gap(Answer):
    """What ISO/IEC 17025 asks a certificate for and this one lacks."""

    code: str
    message: str


class CalibrationAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "cal_1",
                    "camera_id": "cam_1",
                    "campaign_id": "cmp_1",
                    "method": "luminance",
                    "version": 1,
                    "state": "draft",
                    "configuration": {},
                    "coefficients": [
                        {
                            "name": "luminance_k",
                            "value": 33.1,
                            "standard_uncertainty": 0.4,
                            "unit": "DN*m2/(cd*s)",
                            "iso": 3200,
                            "model": "proportional",
                            "flags": [],
                        }
                    ],
                    "parameters": {},
                    "software": {"stilb": "0.1.2", "release": "0.2.0"},
                    "content_sha256": "0" * 64,
                    "created_at": "2026-05-01T08:00:00Z",
                    "created_by": "key_1",
                }
            ]
        }
    )

    id: str
    camera_id: str
    campaign_id: str
    method: str
    version: int
    state: State
    configuration: dict[str, Any]
    coefficients: list[Coefficient]
    parameters: dict[str, Any]
    diagnostics: dict[str, Any] | None = None
    points: list[dict[str, Any]] | None = None
    inputs: dict[str, Any] | None = None
    software: dict[str, Any] = Field(
        description="The fit code version (`stilb`), the release (`release`) and the packages that fitted."
    )
    content_sha256: str
    created_at: Instant
    created_by: str
    valid_from: Instant | None = None
    valid_to: Instant | None = None
    superseded_by: str | None = None
    revoked_reason: str | None = None
    warnings: list[Gap] | None = Field(
        default=None, description="When it is published: what its certificate lacks."
    )

    @classmethod
    def of(
        cls, row: Calibration, status: VersionStatus, coefficients: list[CoefficientRow], *, whole: bool
    ) -> "CalibrationAnswer":
        """``whole``: with points, diagnostics and inputs, which a list leaves out."""
        detail: dict[str, Any] = {}
        if whole:
            result = drop_absent(row.result)
            detail = {"points": result.pop("points", []), "diagnostics": result, "inputs": row.inputs}
        return cls(
            **{name: getattr(row, name) for name in _FROM_ROW},
            parameters=drop_absent(row.parameters),
            state=status.state,
            coefficients=[Coefficient.of(c) for c in coefficients],
            valid_from=status.valid_from,
            valid_to=status.valid_to,
            superseded_by=status.superseded_by,
            revoked_reason=status.revoked_reason,
            **detail,
        )


_FROM_ROW = (
    *("id", "camera_id", "campaign_id", "method", "version", "configuration", "software"),
    *("content_sha256", "created_at", "created_by"),
)
