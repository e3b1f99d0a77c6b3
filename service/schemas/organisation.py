"""An organisation as its own keys see and change it."""

from pydantic import ConfigDict, Field

from service.schemas.base import Answer, Form, Instant, LongText


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


class OwnOrganisationAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "org_1",
                    "name": "City of Lansing",
                    "refuses_incomplete_certificates": False,
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
