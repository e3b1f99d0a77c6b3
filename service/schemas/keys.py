"""Keys, and the organisations that they belong to."""

from typing import Annotated, Any

from pydantic import ConfigDict, Field

from service.auth import Scope
from service.schemas.base import Answer, Form, Instant, Text
from store.tables import ApiKey, Organisation, WebSession


class NewKey(Form):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"name": "dashboard", "scopes": ["read"], "expires_at": "2099-05-01T00:00:00Z"}]
        }
    )

    name: Text
    scopes: Annotated[list[Scope], Field(min_length=1, max_length=5)]
    expires_at: Instant | None = Field(
        default=None, description="The key, and sessions opened with it, end then; without it, when revoked."
    )


class KeyAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"id": "key_1", "name": "dashboard", "scopes": ["read"], "created_at": "2026-05-01T08:00:00Z"}
            ]
        }
    )

    id: str
    name: str
    scopes: list[Scope]
    created_at: Instant
    expires_at: Instant | None = None
    last_used_at: Instant | None = Field(default=None, description="To ten minutes.")
    revoked_at: Instant | None = None
    secret: str | None = Field(
        default=None,
        description="The key itself: shown once, kept only as a hash, not repeated to a repeated request.",
    )

    @classmethod
    def of(cls, row: ApiKey) -> "KeyAnswer":
        return cls.model_validate(row)

    def keep(self) -> dict[str, Any]:
        return self.model_copy(update={"secret": None}).dump()


class OrganisationNamed(Answer):
    id: str
    name: str


class OwnKeyAnswer(Answer):
    """The key of the one who asks, and the organisation that it belongs to."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "key_1",
                    "name": "field laptop",
                    "scopes": ["read", "upload", "calibrate"],
                    "organisation": {"id": "org_1", "name": "City of Lansing"},
                    "created_at": "2026-05-01T08:00:00Z",
                }
            ]
        }
    )

    id: str
    name: str
    scopes: list[Scope]
    organisation: OrganisationNamed
    created_at: Instant
    expires_at: Instant | None = None
    last_used_at: Instant | None = Field(default=None, description="To ten minutes.")

    @classmethod
    def own(cls, key: ApiKey, organisation: Organisation) -> "OwnKeyAnswer":
        named = OrganisationNamed.model_validate(organisation)
        return cls.model_validate({**KeyAnswer.of(key).dump(), "organisation": named})


class NewOrganisation(Form):
    model_config = ConfigDict(json_schema_extra={"examples": [{"name": "City of Lansing"}]})

    name: Text


class OrganisationAnswer(Answer):
    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"id": "org_1", "name": "City of Lansing", "created_at": "2026-05-01T08:00:00Z"}]
        }
    )

    id: str
    name: str
    created_at: Instant
    key: KeyAnswer | None = Field(default=None, description="The organisation's first key, with every scope.")

    @classmethod
    def of(cls, row: Organisation, key: KeyAnswer | None = None) -> "OrganisationAnswer":
        return cls(id=row.id, name=row.name, created_at=row.created_at, key=key)

    def keep(self) -> dict[str, Any]:
        return self.dump() | ({"key": self.key.keep()} if self.key else {})


class SessionAnswer(Answer):
    """A browser that is signed in with a key."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "id": "ses_1",
                    "key_id": "key_1",
                    "key_name": "dashboard",
                    "browser": "Mozilla/5.0",
                    "current": False,
                    "created_at": "2026-05-01T08:00:00Z",
                    "expires_at": "2026-05-01T20:00:00Z",
                }
            ]
        }
    )

    id: str
    key_id: str
    key_name: str
    browser: str | None = Field(default=None, description="As it names itself.")
    current: bool = Field(description="Whether it is the one that asks.")
    created_at: Instant
    expires_at: Instant
    last_used_at: Instant | None = Field(default=None, description="To ten minutes.")
    ended_at: Instant | None = None

    @classmethod
    def of(cls, row: WebSession, *, key_name: str, current: bool) -> "SessionAnswer":
        said = {name: getattr(row, name) for name in cls.model_fields if name not in {"key_name", "current"}}
        return cls(**said, key_name=key_name, current=current)
