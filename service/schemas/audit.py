"""Entries of the audit trail."""

from typing import Any

from pydantic import ConfigDict, Field

from service.schemas.base import Answer, Instant


class AuditEntryAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "seq": 7,
                    "at": "2026-05-01T08:00:00Z",
                    "actor": "key_1",
                    "action": "camera.change",
                    "subject_type": "camera",
                    "subject_id": "cam_1",
                    "before": {"note": "new"},
                    "after": {"note": "dropped once"},
                    "previous_sha256": "0" * 64,
                    "sha256": "1" * 64,
                }
            ]
        }
    )

    seq: int = Field(description="Counts over all organisations: what lies between is another's.")
    at: Instant
    actor: str = Field(description="A key's id, or the process that acted by itself.")
    action: str
    subject_type: str
    subject_id: str
    before: dict[str, Any]
    after: dict[str, Any]
    previous_sha256: str
    sha256: str
