"""What need not be uploaded, because the campaign has it already."""

from fastapi import APIRouter, Response

from service.auth import Uploader
from service.changes import IdempotencyKey
from service.context import UsesContext
from service.lookup import Id, owned
from service.routes import problems
from service.schemas.known import HashesAsked, KnownAnswer
from store.queries.known import find_known, read_sizes
from store.tables import Campaign

router = APIRouter(prefix="/v1/campaigns/{campaign_id}/frames/known", tags=["frames"])


@router.post("", response_model=KnownAnswer, responses=problems(404))
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
    with context.database.reading() as session:
        campaign = owned(session, Campaign, campaign_id, caller)
        found = find_known(session, campaign, body.sha256)
        sizes = read_sizes(session, found)
    absent = context.files.find_absent(sizes)
    known = {sha256: frame for sha256, frame in found.items() if sha256 not in absent}
    return KnownAnswer.of(body.sha256, known).respond()
