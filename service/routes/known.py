"""Files that need not be uploaded, because they are there already."""

from collections.abc import Callable, Iterable

from fastapi import Response
from sqlalchemy.orm import Session

from service.auth import Uploader
from service.changes import IdempotencyKey
from service.context import Context, UsesContext
from service.lookup import Id, owned
from service.operations import Router
from service.routes import problems
from service.schemas.known import HashesAsked, KnownAnswer
from store.queries.campaigns import find_known, find_known_anywhere, read_sizes
from store.queries.jobs import find_reading_jobs
from store.tables import Campaign, FrameRow

router = Router(prefix="/v1", tags=["frames"])


@router.post("/uploads/known", response_model=KnownAnswer, responses=problems())
def ask_known(
    body: HashesAsked, caller: Uploader, context: UsesContext, _idempotency_key: IdempotencyKey = None
) -> Response:
    """Ask by hash which files are stored whole, and in which campaigns.

    Nothing is stored: asked again it answers as things stand then, whatever the `Idempotency-Key`.
    """
    return _answer(
        context, body, lambda session: find_known_anywhere(session, caller.organisation_id, body.sha256)
    )


@router.post("/campaigns/{campaign_id}/frames/known", response_model=KnownAnswer, responses=problems(404))
def ask_known_frames(
    campaign_id: Id,
    body: HashesAsked,
    caller: Uploader,
    context: UsesContext,
    _idempotency_key: IdempotencyKey = None,
) -> Response:
    """Ask by hash which files the campaign has, so that only the others are sent.

    Nothing is stored: asked again it answers as things stand then, whatever the `Idempotency-Key`.
    """

    def find(session: Session) -> Iterable[FrameRow]:
        return find_known(session, owned(session, Campaign, campaign_id, caller), body.sha256).values()

    return _answer(context, body, find)


def _answer(context: Context, body: HashesAsked, find: Callable[[Session], Iterable[FrameRow]]) -> Response:
    with context.database.reading() as session:
        found = list(find(session))
        sizes = read_sizes(session, {frame.sha256 for frame in found})
        jobs = find_reading_jobs(session, [frame.id for frame in found])
    absent = context.files.find_absent(sizes)
    whole = [frame for frame in found if frame.sha256 not in absent]
    return KnownAnswer.of(body.sha256, whole, jobs).respond()
