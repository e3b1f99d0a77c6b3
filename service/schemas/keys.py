"""Keys, and the organisations that they belong to."""

from typing import Annotated, Any

from pydantic import Field

from service.auth import Scope
from service.schemas.base import Answer, Clearable, Form, Instant, Text
from store.tables import ApiKey, Organisation, WebSession


class NewKey(Form):
    name: Text = Field(
        description="Of the person, device or program that uses the key; the audit trail names it."
    )
    scopes: Annotated[
        list[Scope],
        Field(min_length=1, max_length=5, description="What the key may do; it cannot be changed later."),
    ]
    person: Text | None = Field(
        default=None, description="Who uses the key: certificates name who fitted and who approved."
    )
    role: Text | None = Field(default=None, description="Of the person in the laboratory.")
    expires_at: Instant | None = Field(
        default=None,
        description="The key, and sessions opened with it, end then; without it, when revoked. "
        "Not in the past.",
    )


class KeyChange(Form):
    person: Clearable | None = Field(
        default=None, description='Who uses the key, as certificates name them; "" takes them away.'
    )
    role: Clearable | None = Field(default=None, description="Of the person in the laboratory.")


class KeyAnswer(
    Answer,
    restates=ApiKey,
    fields="id name person role scopes created_at expires_at last_used_at revoked_at",
):
    scopes: list[Scope]
    secret: str | None = Field(
        default=None,
        description="The key itself: shown once, kept only as a hash, not repeated to a repeated request.",
    )

    def keep(self) -> dict[str, Any]:
        return self.model_copy(update={"secret": None}).dump()


class OrganisationNamed(Answer, restates=Organisation, fields="id name"):
    pass


class OwnKeyAnswer(Answer, restates=ApiKey, fields="id name person role created_at expires_at last_used_at"):
    """The key of the one who asks, and the organisation that it belongs to."""

    scopes: list[Scope]
    organisation: OrganisationNamed


class NewOrganisation(Form):
    name: Text


class OrganisationAnswer(Answer, restates=Organisation, fields="id name created_at"):
    key: KeyAnswer | None = Field(default=None, description="The organisation's first key, with every scope.")

    def keep(self) -> dict[str, Any]:
        return self.dump() | ({"key": self.key.keep()} if self.key else {})


class SessionAnswer(
    Answer, restates=WebSession, fields="id key_id browser created_at expires_at last_used_at ended_at"
):
    """A browser that is signed in with a key."""

    key_name: str
    person: str | None = Field(default=None, description="Of the key.")
    current: bool = Field(description="Whether it is the one that asks.")


class EndedSessions(Answer):
    ended: int = Field(ge=0, description="How many sessions were ended.")
