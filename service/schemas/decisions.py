"""What was decided of a camera's versions."""

from typing import Any, Literal

from pydantic import ConfigDict, Field

from service.schemas.base import Answer, Instant
from store.queries.decisions import Decision

_EXAMPLE: dict[str, Any] = {
    "act": "published",
    "calibration_id": "cal_1",
    "method": "luminance",
    "version": 1,
    "at": "2026-05-02T09:00:00Z",
    "by": "key_1",
    "by_name": "A. Meier",
    "reason": "spring calibration",
    "valid_from": "2026-05-01T00:00:00Z",
}


class DecisionAnswer(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [_EXAMPLE]})

    act: Literal["made", "published", "revoked"]
    calibration_id: str
    method: str
    version: int
    at: Instant
    by: str = Field(description="The id of the key.")
    by_name: str | None = None
    reason: str | None = None
    valid_from: Instant | None = Field(default=None, description="As it was published.")
    valid_to: Instant | None = None

    @classmethod
    def of(cls, row: Decision, names: dict[str, str]) -> "DecisionAnswer":
        return cls(
            **{name: getattr(row, name) for name in ("act", "at", "by", "reason", "valid_from", "valid_to")},
            by_name=names.get(row.by),
            calibration_id=row.calibration.id,
            method=row.calibration.method,
            version=row.calibration.version,
        )


class DecisionsAnswer(Answer):
    model_config = ConfigDict(json_schema_extra={"examples": [{"items": [_EXAMPLE]}]})

    items: list[DecisionAnswer]
