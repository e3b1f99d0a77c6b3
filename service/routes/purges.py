"""Purges by cause: proposed, looked at, confirmed as one step."""

from fastapi import APIRouter, Request, Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.auth import Publisher, Reader
from service.context import UsesContext
from service.lookup import Id, owned
from service.paging import Cursor, Limit, Page, page
from service.routes import problems
from service.schemas.purges import NewPurge, PurgeAnswer
from service.writing import Reply, Writes
from store import purging
from store.tables import Meter, Purge

router = APIRouter(prefix="/v1/purges", tags=["purges"])


@router.post("", status_code=201, response_model=PurgeAnswer, responses=problems(404))
def propose_purge(body: NewPurge, caller: Publisher, writing: Writes) -> Response:
    """Find every version made with a cause, for review. Nothing is revoked yet."""

    def change(session: Session) -> Reply:
        if body.cause.meter_id is not None:
            owned(session, Meter, body.cause.meter_id, caller)
        purge = purging.propose(
            session, caller.organisation_id, body.cause.named(), reason=body.reason, by=caller.key_id
        )
        location = {"Location": f"/v1/purges/{purge.id}"}
        return Reply(status=201, body=_whole(session, purge), headers=location)

    return writing.run(caller, change)


@router.get("", response_model=Page[PurgeAnswer], responses=problems())
def list_purges(
    request: Request, caller: Reader, context: UsesContext, limit: Limit = 100, cursor: Cursor = None
) -> Response:
    """The purges of your organisation, newest first."""
    rows = select(Purge).where(Purge.organisation_id == caller.organisation_id)
    with context.database.reading() as session:
        return page(
            session,
            request,
            rows,
            by=Purge.id,
            limit=limit,
            cursor=cursor,
            newest_first=True,
            shape=lambda found: [PurgeAnswer.of(row) for row in found],
        )


@router.get("/{purge_id}", response_model=PurgeAnswer, responses=problems(404))
def get_purge(purge_id: Id, caller: Reader, context: UsesContext) -> Response:
    """One purge with its versions as they stand now, and the measurements that lose them."""
    with context.database.reading() as session:
        return _whole(session, owned(session, Purge, purge_id, caller)).respond()


@router.post("/{purge_id}/confirm", response_model=PurgeAnswer, responses=problems(404, 409))
def confirm_purge(purge_id: Id, caller: Publisher, writing: Writes) -> Response:
    """Revoke all versions of a purge in one step. Refused when the cause finds others than were reviewed."""

    def change(session: Session) -> Reply:
        purge = owned(session, Purge, purge_id, caller)
        purging.confirm(session, purge, by=caller.key_id)
        return Reply(status=200, body=_whole(session, purge))

    return writing.run(caller, change)


def _whole(session: Session, purge: Purge) -> PurgeAnswer:
    return PurgeAnswer.of(purge, purging.review(session, purge))
