"""Server-sent events: a job or a campaign, followed on one connection."""

import json
from collections.abc import AsyncIterator
from typing import Annotated, Any, Final

from fastapi import Header, Response
from fastapi.responses import StreamingResponse
from starlette.concurrency import run_in_threadpool

from service.auth import Caller, Reader
from service.context import Context, UsesContext
from service.job_watch import Event, Kind
from service.lookup import Id, owned
from service.operations import Router
from service.routes import problems
from service.schemas.base import Text
from store.tables import Campaign, Job

router = Router(prefix="/v1", tags=["events"])

_STREAM: Final = "text/event-stream"
_RETRY_MS: Final = 3000
_RESPONSES: Final[dict[int | str, dict[str, Any]]] = {
    200: {
        "description": "Events with the fields `id`, `event` and `data`, which is JSON, as they happen.",
        "content": {_STREAM: {"schema": {}}},
    },
    **problems(404),
}
LastEventId = Annotated[
    Text | None,
    Header(alias="Last-Event-ID", description="Of the last event seen: it is not sent again."),
]


@router.get("/jobs/{job_id}/events", response_class=Response, responses=_RESPONSES)
async def follow_job(
    job_id: Id, caller: Reader, context: UsesContext, last_event_id: LastEventId = None
) -> Response:
    """Follow a job until it ends: server-sent events `job` with its state, progress and attempt.

    Each event is the state as it is then; states that lasted less than half a second may be skipped. A
    comment every 15 s keeps the connection alive. The event `end` states in `code` why the stream ends early:
    the key was revoked, or the service stops. One key may have 20 streams open.
    """
    return await _follow(context, caller, "job", job_id, last_event_id)


@router.get("/campaigns/{campaign_id}/events", response_class=Response, responses=_RESPONSES)
async def follow_campaign(
    campaign_id: Id, caller: Reader, context: UsesContext, last_event_id: LastEventId = None
) -> Response:
    """Follow a campaign: a server-sent event `campaign` with its revision, first as it is, then as it rises.

    The revision rises with every change of the campaign, its frames, readings and versions: ask for what you
    show again. Otherwise as for a job; a campaign has no end.
    """
    return await _follow(context, caller, "campaign", campaign_id, last_event_id)


async def _follow(
    context: Context, caller: Caller, kind: Kind, subject_id: str, seen: str | None
) -> Response:
    def check() -> None:
        with context.database.reading() as session:
            owned(session, Job if kind == "job" else Campaign, subject_id, caller)

    await run_in_threadpool(check)
    context.watch.admit(caller.who)
    events = context.watch.follow(kind, subject_id, caller.who, seen=seen or "")
    return StreamingResponse(
        _write(events), media_type=_STREAM, headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    )


async def _write(events: AsyncIterator[Event | None]) -> AsyncIterator[str]:
    yield f"retry: {_RETRY_MS}\n\n"
    async for event in events:
        if event is None:
            yield ":\n\n"
        else:
            mark = f"id: {event.id}\n" if event.id else ""
            yield f"{mark}event: {event.kind}\ndata: {json.dumps(event.data)}\n\n"
