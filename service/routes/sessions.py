"""The sessions that browsers have open, and how they are ended."""

from typing import Annotated

from fastapi import Depends, Query, Response
from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from service.auth import Caller, get_caller
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.paging import Page, UsesPaging
from service.problems import not_found
from service.routes import problems
from service.schemas.base import Text
from service.schemas.keys import EndedSessions, SessionAnswer
from store.queries.organisations import is_open
from store.tables import ApiKey, WebSession
from store.tables.base import utc_now

router = Router(prefix="/v1/sessions", tags=["keys"])

AnyCaller = Annotated[Caller, Depends(get_caller)]
OfKey = Annotated[Text | None, Query(description="Only those opened with this key.")]


@router.get("", response_model=Page[SessionAnswer], responses=problems())
def list_sessions(
    paging: UsesPaging, caller: AnyCaller, context: UsesContext, key_id: OfKey = None
) -> Response:
    """The browsers that are signed in with your key; for an admin, with any key of the organisation."""
    rows = _select(caller, key_id)
    with context.database.reading() as session:
        return paging.send(session, rows, lambda found: [_answer(session, row, caller) for row in found])


@router.delete("", response_model=EndedSessions, responses=problems())
def end_other_sessions(caller: AnyCaller, writing: Writes, key_id: OfKey = None) -> Response:
    """End every session that the list shows, except the one that asks."""

    def change(session: Session) -> Reply:
        others = [row for row in session.scalars(_select(caller, key_id)) if row.id != caller.session_id]
        for row in others:
            row.ended_at = utc_now()
        return Reply(status=200, body=EndedSessions(ended=len(others)))

    return writing.run(caller, change)


@router.delete("/{session_id}", response_model=SessionAnswer, responses=problems(404))
def end_session(session_id: Id, caller: AnyCaller, writing: Writes) -> Response:
    """End a session at once: its browser has to sign in again. It stays in the record."""

    def change(session: Session) -> Reply:
        row = owned(session, WebSession, session_id, caller)
        if row.key_id != caller.key_id and not _is_admin(caller):
            raise not_found("session")
        row.ended_at = row.ended_at or utc_now()
        session.flush()
        return Reply(status=200, body=_answer(session, row, caller))

    return writing.run(caller, change)


def _select(caller: Caller, key_id: str | None) -> Select[WebSession]:
    rows = (
        select(WebSession)
        .join(ApiKey, ApiKey.id == WebSession.key_id)
        .where(WebSession.organisation_id == caller.organisation_id, *is_open(), ApiKey.revoked_at.is_(None))
    )
    if not _is_admin(caller):
        rows = rows.where(WebSession.key_id == caller.key_id)
    return rows if key_id is None else rows.where(WebSession.key_id == key_id)


def _is_admin(caller: Caller) -> bool:
    return "admin" in caller.scopes


def _answer(session: Session, row: WebSession, caller: Caller) -> SessionAnswer:
    key = session.get_one(ApiKey, row.key_id)
    return SessionAnswer.restate(
        row, key_name=key.name, person=key.person, current=row.id == caller.session_id
    )
