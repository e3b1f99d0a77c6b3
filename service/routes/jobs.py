"""Jobs, and waiting for them."""

import re
from typing import Annotated, Literal

from fastapi import APIRouter, Header, Query, Request, Response
from sqlalchemy import select
from starlette.concurrency import run_in_threadpool

from service.auth import Caller, Reader
from service.context import Context, UsesContext
from service.lookup import Id, owned
from service.paging import Cursor, Limit, Page, page
from service.routes import problems
from service.schemas.base import Text
from service.schemas.jobs import JobAnswer, State
from store.jobs import FINAL_STATES
from store.tables import Job

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

_WAIT = re.compile(r"\bwait=(\d{1,4})\b")
_LONGEST_WAIT_S = 60


@router.get("", response_model=Page[JobAnswer], responses=problems())
def list_jobs(
    request: Request,
    caller: Reader,
    context: UsesContext,
    limit: Limit = 100,
    cursor: Cursor = None,
    state: Annotated[State | None, Query()] = None,
    kind: Annotated[Literal["extract", "fit", "measure"] | None, Query()] = None,
) -> Response:
    """The jobs of your organisation, newest first."""
    rows = select(Job).where(Job.organisation_id == caller.organisation_id)
    if state is not None:
        rows = rows.where(Job.state == state)
    if kind is not None:
        rows = rows.where(Job.kind == kind)
    with context.database.reading() as session:
        return page(
            session,
            request,
            rows,
            by=Job.id,
            limit=limit,
            cursor=cursor,
            newest_first=True,
            shape=lambda found: [JobAnswer.of(row) for row in found],
        )


@router.get("/{job_id}", response_model=JobAnswer, responses=problems(404))
async def get_job(
    job_id: Id,
    caller: Reader,
    context: UsesContext,
    prefer: Annotated[
        Text | None, Header(description="`wait=N`: answer when it ends, N seconds at most.")
    ] = None,
) -> Response:
    """One job. `Prefer: wait=N` (60 at most) answers when it has ended, or after N seconds."""
    answer = await run_in_threadpool(_read, context, caller, job_id)
    wanted = _WAIT.search(prefer or "")
    headers = {}
    if wanted is not None:
        headers["Preference-Applied"] = f"wait={min(int(wanted[1]), _LONGEST_WAIT_S)}"
        if answer.state not in FINAL_STATES:
            await context.watch.wait(job_id, min(int(wanted[1]), _LONGEST_WAIT_S))
            answer = await run_in_threadpool(_read, context, caller, job_id)
    return answer.respond(headers)


def _read(context: Context, caller: Caller, job_id: str) -> JobAnswer:
    with context.database.reading() as session:
        return JobAnswer.of(owned(session, Job, job_id, caller))
