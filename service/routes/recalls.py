"""Recalls: all versions with one cause, proposed, reviewed and revoked in one step."""

from fastapi import Response
from sqlalchemy import select
from sqlalchemy.orm import Session

from service.auth import Publisher, Reader
from service.changes import Reply, Writes
from service.context import UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.paging import Page, UsesPaging
from service.routes import problems
from service.schemas.recalls import NewPurge, PurgeAnswer
from store import impact as recalls
from store.tables import Meter, Recall

router = Router(prefix="/v1/recalls", tags=["recalls"])


@router.post("", status_code=201, response_model=PurgeAnswer, responses=problems(404))
def propose_recall(body: NewPurge, caller: Publisher, writing: Writes) -> Response:
    """Find every version made with a cause, for review. Nothing is revoked yet."""

    def change(session: Session) -> Reply:
        if body.cause.meter_id is not None:
            owned(session, Meter, body.cause.meter_id, caller)
        recall = recalls.propose(
            session, caller.organisation_id, body.cause.named(), reason=body.reason, by=caller.key_id
        )
        location = {"Location": f"/v1/recalls/{recall.id}"}
        return Reply(status=201, body=_whole(session, recall), headers=location)

    return writing.run(caller, change)


@router.get("", response_model=Page[PurgeAnswer], responses=problems())
def list_recalls(paging: UsesPaging, caller: Reader, context: UsesContext) -> Response:
    """List the recalls of your organisation, newest first."""
    rows = select(Recall).where(Recall.organisation_id == caller.organisation_id)
    with context.database.reading() as session:
        return paging.send(
            session, rows, lambda found: [PurgeAnswer.of(row) for row in found], newest_first=True
        )


@router.get("/{recall_id}", response_model=PurgeAnswer, responses=problems(404))
def get_recall(recall_id: Id, caller: Reader, context: UsesContext) -> Response:
    """Return a recall with the current status of its versions, and the measurements that they affect."""
    with context.database.reading() as session:
        return _whole(session, owned(session, Recall, recall_id, caller)).respond()


@router.post("/{recall_id}/confirm", response_model=PurgeAnswer, responses=problems(404, 409))
def confirm_recall(recall_id: Id, caller: Publisher, writing: Writes) -> Response:
    """Revoke all versions of a recall in one step. Answers 409 if the cause now finds other versions."""

    def change(session: Session) -> Reply:
        recall = owned(session, Recall, recall_id, caller)
        recalls.confirm(session, recall, by=caller.key_id)
        return Reply(status=200, body=_whole(session, recall))

    return writing.run(caller, change)


def _whole(session: Session, recall: Recall) -> PurgeAnswer:
    return PurgeAnswer.of(recall, recalls.review(session, recall))
