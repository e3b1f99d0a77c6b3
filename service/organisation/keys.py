"""Organisations, keys, and the sessions that browsers have open."""

from typing import Annotated, Any

from fastapi import Depends, Query, Response
from pydantic import Field
from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.http import auth, changes, lookup, operations
from service.http.answers import problems
from service.http.context import UsesContext
from service.http.models import Answer, Clearable, Form, Instant, Text
from service.http.paging import Page, UsesPaging
from service.http.problems import Problem, invalid, not_found
from service.organisation.routes import require_free_name
from store.queries.organisations import Person, create_key, end_sessions, has_other_admin, is_open, new_secret
from store.tables import ApiKey, Organisation, WebSession
from store.tables.base import utc_now


class NewKey(Form):
    name: Text = Field(
        description="Of the person, device or program that uses the key; the audit trail names it."
    )
    scopes: Annotated[
        list[auth.Scope],
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
    Answer, restates=ApiKey, fields="id name person role scopes created_at expires_at last_used_at revoked_at"
):
    scopes: list[auth.Scope]
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

    scopes: list[auth.Scope]
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


router = operations.Router(prefix="/v1", tags=["keys"])


@router.post("/organisations", status_code=201, response_model=OrganisationAnswer, responses=problems(409))
def create_organisation(body: NewOrganisation, caller: auth.Admin, writing: changes.Writes) -> Response:
    """Found an organisation; its first key is shown once. Only the operator's admins may."""
    if not caller.operator:
        raise Problem(
            interface.SCOPE_MISSING, "Only an administrator of the operator can create organisations."
        )

    def change(session: Session) -> changes.Reply:
        require_free_name(session, body.name)
        organisation = Organisation(name=body.name)
        session.add(organisation)
        session.flush()
        key = _create(session, organisation.id, NewKey(name="first", scopes=list(auth.SCOPES)))
        return changes.Reply(status=201, body=OrganisationAnswer.restate(organisation, key=key))

    return writing.run(caller, change)


@router.post("/keys", status_code=201, response_model=KeyAnswer, responses=problems())
def create_api_key(body: NewKey, caller: auth.Admin, writing: changes.Writes) -> Response:
    """Make a key of your organisation. Its secret is in this answer and nowhere else."""
    return writing.run(
        caller, lambda session: changes.Reply(status=201, body=_create(session, caller.organisation_id, body))
    )


@router.get("/keys", response_model=Page[KeyAnswer], responses=problems())
def list_keys(paging: UsesPaging, caller: auth.Admin, context: UsesContext) -> Response:
    """The keys of your organisation, without their secrets."""
    rows = select(ApiKey).where(ApiKey.organisation_id == caller.organisation_id)
    with context.database.reading() as session:
        return paging.send(session, rows, lambda found: [KeyAnswer.restate(row) for row in found])


@router.get("/keys/own", response_model=OwnKeyAnswer, responses=problems())
def get_own_key(caller: Annotated[auth.Caller, Depends(auth.get_caller)], context: UsesContext) -> Response:
    """The key that you ask with: whose it is and what it may do. Any key may ask."""
    with context.database.reading() as session:
        key = session.get_one(ApiKey, caller.key_id)
        organisation = session.get_one(Organisation, caller.organisation_id)
        return OwnKeyAnswer.restate(key, organisation=organisation).respond()


@router.patch("/keys/{key_id}", response_model=KeyAnswer, responses=problems(404))
def change_key(key_id: lookup.Id, body: KeyChange, caller: auth.Admin, writing: changes.Writes) -> Response:
    """State the person behind a key, with name and role ("" for none). Issued certificates stay as they are.

    Whoever publishes with the key signs the certificates that are issued then.
    """

    def change(session: Session) -> changes.Reply:
        key = lookup.owned(session, ApiKey, key_id, caller)
        for name, value in body.model_dump(exclude_unset=True).items():
            setattr(key, name, value or None)
        _require_both(key.person, key.role)
        session.flush()
        return changes.Reply(status=200, body=KeyAnswer.restate(key))

    return writing.run(caller, change)


@router.delete("/keys/{key_id}", response_model=KeyAnswer, responses=problems(404, 409))
def revoke_key(key_id: lookup.Id, caller: auth.Admin, writing: changes.Writes) -> Response:
    """Revoke a key at once, and end the sessions opened with it. It stays in the record.

    The last key in force with the scope `admin` cannot be revoked: make another one first.
    """

    def change(session: Session) -> changes.Reply:
        key = lookup.owned(session, ApiKey, key_id, caller)
        if key.revoked_at is None and not has_other_admin(session, key):
            raise Problem(
                interface.CONFLICT, "This is the last key that can manage keys. Make another first."
            )
        end_sessions(session, key)
        key.revoked_at = key.revoked_at or utc_now()
        session.flush()
        return changes.Reply(status=200, body=KeyAnswer.restate(key))

    return writing.run(caller, change)


def _create(session: Session, organisation_id: str, new: NewKey) -> KeyAnswer:
    secret = new_secret()
    if new.expires_at is not None and new.expires_at <= utc_now():
        message = "lies in the past: such a key would open nothing"
        raise invalid([{"type": "expiry", "loc": ("body", "expires_at"), "msg": message}])
    _require_both(new.person, new.role)
    key = create_key(
        session,
        organisation_id=organisation_id,
        name=new.name,
        person=Person(new.person, new.role) if new.person and new.role else None,
        scopes=list(new.scopes),
        secret=secret,
        expires_at=new.expires_at,
    )
    return KeyAnswer.restate(key, secret=secret)


def _require_both(person: str | None, role: str | None) -> None:
    if bool(person) != bool(role):
        lacking = "role" if person else "person"
        message = "is missing: a certificate names a person with name and role"
        raise invalid([{"type": "person", "loc": ("body", lacking), "msg": message}])


sessions_router = operations.Router(prefix="/v1/sessions", tags=["keys"])

AnyCaller = Annotated[auth.Caller, Depends(auth.get_caller)]
OfKey = Annotated[Text | None, Query(description="Only those opened with this key.")]


@sessions_router.get("", response_model=Page[SessionAnswer], responses=problems())
def list_sessions(
    paging: UsesPaging, caller: AnyCaller, context: UsesContext, key_id: OfKey = None
) -> Response:
    """The browsers that are signed in with your key; for an admin, with any key of the organisation."""
    rows = _select(caller, key_id)
    with context.database.reading() as session:
        return paging.send(session, rows, lambda found: [_answer(session, row, caller) for row in found])


@sessions_router.delete("", response_model=EndedSessions, responses=problems())
def end_other_sessions(caller: AnyCaller, writing: changes.Writes, key_id: OfKey = None) -> Response:
    """End every session that the list shows, except the one that asks."""

    def change(session: Session) -> changes.Reply:
        others = [row for row in session.scalars(_select(caller, key_id)) if row.id != caller.session_id]
        for row in others:
            row.ended_at = utc_now()
        return changes.Reply(status=200, body=EndedSessions(ended=len(others)))

    return writing.run(caller, change)


@sessions_router.delete("/{session_id}", response_model=SessionAnswer, responses=problems(404))
def end_session(session_id: lookup.Id, caller: AnyCaller, writing: changes.Writes) -> Response:
    """End a session at once: its browser has to sign in again. It stays in the record."""

    def change(session: Session) -> changes.Reply:
        row = lookup.owned(session, WebSession, session_id, caller)
        if row.key_id != caller.key_id and not _is_admin(caller):
            raise not_found("session")
        row.ended_at = row.ended_at or utc_now()
        session.flush()
        return changes.Reply(status=200, body=_answer(session, row, caller))

    return writing.run(caller, change)


def _select(caller: auth.Caller, key_id: str | None) -> Select[WebSession]:
    rows = (
        select(WebSession)
        .join(ApiKey, ApiKey.id == WebSession.key_id)
        .where(WebSession.organisation_id == caller.organisation_id, *is_open(), ApiKey.revoked_at.is_(None))
    )
    if not _is_admin(caller):
        rows = rows.where(WebSession.key_id == caller.key_id)
    return rows if key_id is None else rows.where(WebSession.key_id == key_id)


def _is_admin(caller: auth.Caller) -> bool:
    return "admin" in caller.scopes


def _answer(session: Session, row: WebSession, caller: auth.Caller) -> SessionAnswer:
    key = session.get_one(ApiKey, row.key_id)
    return SessionAnswer.restate(
        row, key_name=key.name, person=key.person, current=row.id == caller.session_id
    )
