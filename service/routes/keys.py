"""Organisations and keys."""

from typing import Annotated

from fastapi import Depends, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from service.auth import SCOPES, Admin, Caller, get_caller
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.paging import Page, UsesPaging
from service.problems import Problem, invalid
from service.routes import problems
from service.routes.organisation import require_free_name
from service.schemas.keys import (
    KeyAnswer,
    KeyChange,
    NewKey,
    NewOrganisation,
    OrganisationAnswer,
    OwnKeyAnswer,
)
from store.queries.organisations import Person, create_key, end_sessions, has_other_admin, new_secret
from store.tables import ApiKey, Organisation
from store.tables.base import utc_now

router = Router(prefix="/v1", tags=["keys"])


@router.post("/organisations", status_code=201, response_model=OrganisationAnswer, responses=problems(409))
def create_organisation(body: NewOrganisation, caller: Admin, writing: Writes) -> Response:
    """Found an organisation; its first key is shown once. Only the operator's admins may."""
    if not caller.operator:
        raise Problem(
            interface.SCOPE_MISSING, "Only an administrator of the operator can create organisations."
        )

    def change(session: Session) -> Reply:
        require_free_name(session, body.name)
        organisation = Organisation(name=body.name)
        session.add(organisation)
        session.flush()
        key = _create(session, organisation.id, NewKey(name="first", scopes=list(SCOPES)))
        return Reply(status=201, body=OrganisationAnswer.restate(organisation, key=key))

    return writing.run(caller, change)


@router.post("/keys", status_code=201, response_model=KeyAnswer, responses=problems())
def create_api_key(body: NewKey, caller: Admin, writing: Writes) -> Response:
    """Make a key of your organisation. Its secret is in this answer and nowhere else."""
    return writing.run(
        caller, lambda session: Reply(status=201, body=_create(session, caller.organisation_id, body))
    )


@router.get("/keys", response_model=Page[KeyAnswer], responses=problems())
def list_keys(paging: UsesPaging, caller: Admin, context: UsesContext) -> Response:
    """The keys of your organisation, without their secrets."""
    rows = select(ApiKey).where(ApiKey.organisation_id == caller.organisation_id)
    with context.database.reading() as session:
        return paging.send(session, rows, lambda found: [KeyAnswer.restate(row) for row in found])


@router.get("/keys/own", response_model=OwnKeyAnswer, responses=problems())
def get_own_key(caller: Annotated[Caller, Depends(get_caller)], context: UsesContext) -> Response:
    """The key that you ask with: whose it is and what it may do. Any key may ask."""
    with context.database.reading() as session:
        key = session.get_one(ApiKey, caller.key_id)
        organisation = session.get_one(Organisation, caller.organisation_id)
        return OwnKeyAnswer.restate(key, organisation=organisation).respond()


@router.patch("/keys/{key_id}", response_model=KeyAnswer, responses=problems(404))
def change_key(key_id: Id, body: KeyChange, caller: Admin, writing: Writes) -> Response:
    """State the person behind a key, with name and role ("" for none). Issued certificates stay as they are.

    Whoever publishes with the key signs the certificates that are issued then.
    """

    def change(session: Session) -> Reply:
        key = owned(session, ApiKey, key_id, caller)
        for name, value in body.model_dump(exclude_unset=True).items():
            setattr(key, name, value or None)
        _require_both(key.person, key.role)
        session.flush()
        return Reply(status=200, body=KeyAnswer.restate(key))

    return writing.run(caller, change)


@router.delete("/keys/{key_id}", response_model=KeyAnswer, responses=problems(404, 409))
def revoke_key(key_id: Id, caller: Admin, writing: Writes) -> Response:
    """Revoke a key at once, and end the sessions opened with it. It stays in the record.

    The last key in force with the scope `admin` cannot be revoked: make another one first.
    """

    def change(session: Session) -> Reply:
        key = owned(session, ApiKey, key_id, caller)
        if key.revoked_at is None and not has_other_admin(session, key):
            raise Problem(
                interface.CONFLICT, "This is the last key that can manage keys. Make another first."
            )
        end_sessions(session, key)
        key.revoked_at = key.revoked_at or utc_now()
        session.flush()
        return Reply(status=200, body=KeyAnswer.restate(key))

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
    """Refuse half a signature."""
    if bool(person) != bool(role):
        lacking = "role" if person else "person"
        message = "is missing: a certificate names a person with name and role"
        raise invalid([{"type": "person", "loc": ("body", lacking), "msg": message}])
