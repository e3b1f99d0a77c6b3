"""An organisation as its own keys see and change it."""

from pydantic import ConfigDict, Field

from service.schemas.base import Answer, Form, Instant, LongText
from store.settings import Settings
from store.tables import Organisation
from store.usage import Quotas, Used


class OrganisationChange(Form):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"address": "124 W Michigan Ave, Lansing", "refuses_incomplete_certificates": True}]
        }
    )

    address: LongText | None = None
    refuses_incomplete_certificates: bool | None = Field(
        default=None,
        description="Publishing answers 409 `certificate_incomplete` while a certificate has gaps.",
        strict=True,
    )


class UsageAnswer(Answer):
    """What an organisation uses; a limit that is absent is none."""

    frames: int
    frames_limit: int | None = None
    stored_bytes: int = Field(description="Of the files of its frames.")
    stored_bytes_limit: int | None = None
    jobs_waiting: int
    jobs_waiting_limit: int | None = None
    requests_in_minute: int = Field(description="As the process that answers has counted them.")
    requests_in_minute_limit: int | None = None

    @classmethod
    def of(cls, used: Used, quotas: Quotas, requests: int, settings: Settings) -> "UsageAnswer":
        return cls(
            frames=used.frames,
            frames_limit=quotas.frames or None,
            stored_bytes=used.stored_bytes,
            stored_bytes_limit=quotas.stored_bytes or None,
            jobs_waiting=used.jobs_waiting,
            jobs_waiting_limit=quotas.jobs_waiting or None,
            requests_in_minute=requests,
            requests_in_minute_limit=settings.quota_requests_per_minute or None,
        )


class OwnOrganisationAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "org_1",
                    "name": "City of Lansing",
                    "refuses_incomplete_certificates": False,
                    "usage": {
                        "frames": 128,
                        "stored_bytes": 5376000000,
                        "jobs_waiting": 3,
                        "jobs_waiting_limit": 50000,
                        "requests_in_minute": 12,
                        "requests_in_minute_limit": 30000,
                    },
                    "created_at": "2026-05-01T08:00:00Z",
                }
            ]
        }
    )

    id: str
    name: str
    address: str | None = None
    refuses_incomplete_certificates: bool
    created_at: Instant
    usage: UsageAnswer | None = Field(default=None, description="In the answer to GET.")

    @classmethod
    def of(cls, row: Organisation, usage: UsageAnswer) -> "OwnOrganisationAnswer":
        return cls.model_validate(row).model_copy(update={"usage": usage})
