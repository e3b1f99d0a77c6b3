"""Jobs as a client sees them, waiting for them, and server-sent events."""

import json
import re
from collections.abc import AsyncIterator
from typing import Annotated, Any, Final, Literal, get_args

from fastapi import Header, Query, Response
from fastapi.responses import StreamingResponse
from pydantic import Field
from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from service.http import answers, auth, changes, lookup, models, operations, problems
from service.http.context import Context, UsesContext
from service.http.paging import Page, UsesPaging
from service.jobs import watch
from store import audit, jobs, tables
from store.queries import by_id, usage
from store.queries import jobs as queries


class JobAnswer(
    models.Answer,
    restates=tables.Job,
    fields="id kind subject_id state progress attempt result created_at finished_at dismissed_at",
):
    state: tables.JobState
    progress: float = Field(ge=0, le=1)
    error: models.ProblemAnswer | None = None
    filename: str | None = models.maybe("Of the frame that it works on, where it is one.")
    campaign_id: str | None = models.maybe("The campaign of that frame, or its subject.")
    next_attempt_at: models.Instant | None = models.maybe(
        "When a job is tried again that waits for what `error.waits_for` names, if not sooner."
    )

    @classmethod
    def of(cls, row: tables.Job, frame: tables.FrameRow | None = None) -> "JobAnswer":
        error = None
        if row.error is not None:
            status = 422 if row.state == "failed" and row.traceback is None else 500
            error = problems.problem_body(row.error.get("status", status), **row.error)
        return cls.restate(
            row,
            error=error,
            next_attempt_at=row.due_at if row.state == "queued" and error is not None else None,
            filename=frame.filename if frame else None,
            campaign_id=frame.campaign_id if frame else row.subject_id if row.kind == "fit" else None,
        )


class RetriedJobs(models.Form):
    """Which jobs are tried again: those that all of this holds for."""

    state: Literal["failed", "quarantined"]
    kind: tables.JobKind | None = None
    code: models.Text | None = models.maybe("The code of the error that they ended with.")
    campaign_id: models.Text | None = models.maybe("Jobs on this campaign and its frames.")


class DismissedJobs(RetriedJobs):
    """Which jobs are dismissed: those that all of this holds for."""

    dismissed: models.Flag = models.told("false: list them again.", default=True)


class DismissedAnswer(models.Answer):
    dismissed: int = models.told("How many jobs were changed.", ge=0)


class JobCauseAnswer(models.Answer):
    """Jobs that failed for one reason, with the newest of them."""

    count: int = Field(ge=1)
    newest: JobAnswer


class JobCausesAnswer(models.Answer):
    items: list[JobCauseAnswer]


class RetriedAnswer(models.Answer):
    retried: int = models.told("How many jobs are queued again.", ge=0)


class QueueAnswer(models.Answer):
    queued: int
    running: int
    succeeded: int
    failed: int
    quarantined: int
    more: list[tables.JobState] = models.told(
        f"States with more jobs than their number states: each is counted up to {queries.MOST_COUNTED}."
    )
    oldest_wait_s: float = models.told("How long the job that waits longest has been due.", ge=0)


router = operations.Router(prefix="/v1/jobs", tags=["jobs"])

_SUBJECTS: Final = (tables.FrameRow, tables.Campaign, tables.Calibration, tables.Measurement, tables.Road)

_WAIT = re.compile(r"\bwait\s*=\s*\"?(\d{1,4})\b", re.IGNORECASE)
_LONGEST_WAIT_S = 60
_LOGGED = 64  # of many jobs the log of a request names the first
_SCOPES: dict[str, auth.Scope] = {"extract": "upload", "fit": "calibrate", "measure": "upload"}


QUEUES: Final[dict[str, Any]] = {"status_code": 202, "response_model": JobAnswer}
"""How a route is stated that queues a job."""


def enqueue(
    session: Session,
    caller: auth.Caller,
    kind: tables.JobKind,
    subject_id: str,
    parameters: dict[str, Any],
    lane: str | None = None,
) -> tables.Job:
    owner: dict[str, Any] = {"organisation_id": caller.organisation_id, "by": caller.key_id}
    return jobs.enqueue(session, kind=kind, subject_id=subject_id, parameters=parameters, lane=lane, **owner)


def reply_queued(session: Session, job: tables.Job, frame: tables.FrameRow | None = None) -> changes.Reply:
    session.flush()
    location = {"Location": f"/v1/jobs/{job.id}"}
    return changes.Reply(status=202, body=JobAnswer.of(job, frame), headers=location, jobs=[job])


def queue(
    session: Session, caller: auth.Caller, frame: tables.FrameRow, parameters: dict[str, Any]
) -> changes.Reply:
    """Queue a picture or a preview of a frame, which somebody waits for."""
    job = enqueue(session, caller, "extract", frame.id, parameters, jobs.PREVIEW_LANE)
    return reply_queued(session, job, frame)


@router.get("", response_model=Page[JobAnswer], responses=answers.problems(404))
def list_jobs(
    paging: UsesPaging,
    caller: auth.Reader,
    session: Session,
    state: tables.JobState | None = None,
    kind: tables.JobKind | None = None,
    dismissed: Annotated[bool | None, Query(description="Only those that were, or were not.")] = None,
    subject: Annotated[
        models.Text | None,
        Query(description="Those on this frame, campaign or road, or that made this version or measurement."),
    ] = None,
) -> Response:
    """The jobs of your organisation, newest first."""
    rows = paging.choose(caller, select(tables.Job), state=state, kind=kind, dismissed=dismissed)
    if subject is not None:
        row = lookup.find_owned(session, _SUBJECTS, subject, caller)
        concerned = tables.Job.subject_id == subject
        if isinstance(row, tables.Calibration | tables.Measurement):
            concerned = queries.select_makers(row)
        rows = rows.where(concerned)
    return paging.send(session, rows, lambda found: _answers(session, found), newest_first=True)


# before the route of one job, whose id it would be taken for
@router.get("/summary", response_model=QueueAnswer)
def get_queue(caller: auth.Reader, session: Session) -> Response:
    """The jobs of your organisation by state, counted up to a bound, and how long the oldest has waited."""
    queue = queries.summarise_queue(session, caller.organisation_id, get_args(tables.JobState))
    return QueueAnswer.restate(queue.counts, queue).respond()


@router.get("/causes", response_model=JobCausesAnswer)
def get_job_causes(caller: auth.Reader, session: Session) -> Response:
    """Why jobs failed or were quarantined, unless they were dismissed; the most frequent cause first.

    Of each state the newest 2,000 jobs count. A cause is a state, a kind, an error's code and a campaign, by
    which `POST /v1/jobs/retry` and `POST /v1/jobs/dismiss` choose too.
    """
    causes = queries.list_causes(session, caller.organisation_id)
    newest = _answers(session, [cause.newest for cause in causes])
    items = [JobCauseAnswer(count=cause.count, newest=job) for cause, job in zip(causes, newest, strict=True)]
    return JobCausesAnswer(items=items).respond()


@router.get("/{job_id}", response_model=JobAnswer)
async def get_job(
    job_id: lookup.Id,
    caller: auth.Reader,
    context: UsesContext,
    prefer: Annotated[
        models.Text | None, Header(description="`wait=N`: answer when it ends, N seconds at most.")
    ] = None,
) -> Response:
    """One job. `Prefer: wait=N` (60 at most) answers when it has ended, or after N seconds."""
    answer = await run_in_threadpool(_read, context, caller, job_id)
    wanted = _WAIT.search(prefer or "")
    headers = {}
    if wanted is not None:
        headers["Preference-Applied"] = f"wait={min(int(wanted[1]), _LONGEST_WAIT_S)}"
        if answer.state not in jobs.FINAL_STATES:
            await context.watch.wait(job_id, min(int(wanted[1]), _LONGEST_WAIT_S))
            answer = await run_in_threadpool(_read, context, caller, job_id)
    return answer.respond(headers)


@router.post("/retry", status_code=202, response_model=RetriedAnswer, responses=answers.problems(404))
def retry_jobs(body: RetriedJobs, caller: auth.Reader, session: Session) -> changes.Reply:
    """Try all jobs again that failed, or were quarantined, of a kind, by an error's code, of a campaign.

    It needs the scopes that starting them needed. Sent twice it finds nothing the second time.
    """
    chosen = _choose(session, caller, body)
    first = list(session.scalars(select(tables.Job).where(chosen).limit(_LOGGED)))
    if retried := jobs.retry(session, chosen):
        asked = body.model_dump(exclude_none=True)
        organisation = session.get_one(tables.Organisation, caller.organisation_id)
        usage.add_jobs(session, retried, organisation_id=organisation.id)
        audit.record_act(session, "retry_jobs", organisation, asked, {"state": "queued", "jobs": retried})
    return changes.Reply(status=202, body=RetriedAnswer(retried=retried), jobs=first)


@router.post("/dismiss", response_model=DismissedAnswer, responses=answers.problems(404))
def dismiss_jobs(body: DismissedJobs, caller: auth.Reader, session: Session) -> changes.Reply:
    """Dismiss jobs that failed, or were quarantined: no page lists them as failures any more.

    They stay in the record, and a retry ends it. It needs the scopes that starting them needed.
    """
    if count := jobs.dismiss(session, _choose(session, caller, body), dismissed=body.dismissed):
        asked = body.model_dump(exclude_none=True)
        organisation = session.get_one(tables.Organisation, caller.organisation_id)
        audit.record_act(session, "dismiss_jobs", organisation, {}, asked | {"jobs": count})
    return changes.Reply(status=200, body=DismissedAnswer(dismissed=count))


@router.post("/{job_id}/retry", status_code=202, response_model=JobAnswer, responses=answers.problems(409))
def retry_job(job: lookup.Own[tables.Job], caller: auth.Reader, session: Session) -> changes.Reply:
    """Try a job again that failed or was quarantined. It needs the scope that starting it needed."""
    auth.require(caller, _SCOPES[job.kind])
    before = {"state": job.state, "error": job.error}
    if not jobs.retry(session, tables.Job.id == job.id):
        detail = f"This job is {job.state}. Only one that failed or was quarantined can be tried again."
        raise problems.Problem(interface.CONFLICT, detail)
    audit.record_act(session, "retry", job, before, {"state": "queued"})
    session.refresh(job)
    return reply_queued(session, job, session.get(tables.FrameRow, job.subject_id))


def _choose(session: Session, caller: auth.Caller, body: RetriedJobs) -> ColumnElement[bool]:
    if body.campaign_id is not None:
        lookup.owned(session, tables.Campaign, body.campaign_id, caller)
    asked = body.model_dump(include=set(RetriedJobs.model_fields))
    chosen = queries.select_given_up(caller.organisation_id, **asked)
    for kind in session.scalars(select(tables.Job.kind).where(chosen).distinct().order_by(tables.Job.kind)):
        auth.require(caller, _SCOPES[kind])
    return chosen


def _read(context: Context, caller: auth.Caller, job_id: str) -> JobAnswer:
    with context.database.reading() as session:
        (answer,) = _answers(session, [lookup.owned(session, tables.Job, job_id, caller)])
    return answer


def _answers(session: Session, found: list[tables.Job]) -> list[JobAnswer]:
    frames = by_id(session, tables.FrameRow, {job.subject_id for job in found})
    return [JobAnswer.of(row, frames.get(row.subject_id)) for row in found]


events_router = operations.Router(prefix="/v1", tags=["events"])

_STREAM: Final = "text/event-stream"
_RETRY_MS: Final = 3000
_RESPONSES: Final[dict[int | str, dict[str, Any]]] = {
    200: {
        "description": "Events with the fields `id`, `event` and `data`, which is JSON, as they happen.",
        "content": {_STREAM: {"schema": {}}},
    },
    **answers.problems(404),
}
LastEventId = Annotated[
    models.Text | None,
    Header(alias="Last-Event-ID", description="Of the last event seen: it is not sent again."),
]


@events_router.get("/jobs/{job_id}/events", response_class=Response, responses=_RESPONSES)
async def follow_job(
    job: lookup.Own[tables.Job], caller: auth.Reader, context: UsesContext, last_event_id: LastEventId = None
) -> Response:
    """Follow a job until it ends: server-sent events `job` with its state, progress and attempt.

    Each event is the state as it is then; states that lasted less than half a second may be skipped. A
    comment every 15 s keeps the connection alive. The event `end` states in `code` why the stream ends early:
    the key was revoked, or the service stops. One key may have 20 streams open.
    """
    return _follow(context, caller, "job", job.id, last_event_id)


@events_router.get("/campaigns/{campaign_id}/events", response_class=Response, responses=_RESPONSES)
async def follow_campaign(
    campaign: lookup.Own[tables.Campaign],
    caller: auth.Reader,
    context: UsesContext,
    last_event_id: LastEventId = None,
) -> Response:
    """Follow a campaign: a server-sent event `campaign` with its revision, first as it is, then as it rises.

    The revision rises with every change of the campaign, its frames, readings and versions: ask for what you
    show again. Otherwise as for a job; a campaign has no end.
    """
    return _follow(context, caller, "campaign", campaign.id, last_event_id)


def _follow(
    context: Context, caller: auth.Caller, kind: watch.Kind, subject_id: str, seen: str | None
) -> Response:
    context.watch.admit(caller.who)
    events = context.watch.follow(kind, subject_id, caller.who, seen=seen or "")
    return StreamingResponse(
        _write(events), media_type=_STREAM, headers={"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    )


async def _write(events: AsyncIterator[watch.Event | None]) -> AsyncIterator[str]:
    yield f"retry: {_RETRY_MS}\n\n"
    async for event in events:
        if event is None:
            yield ":\n\n"
        else:
            mark = f"id: {event.id}\n" if event.id else ""
            yield f"{mark}event: {event.kind}\ndata: {json.dumps(event.data)}\n\n"
