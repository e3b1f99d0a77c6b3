"""The life of a job: queued, claimed with a lease and a fence, finished once, or taken back and tried again.

Every step is one conditional UPDATE: two workers that choose the same job, or a worker that comes back
from the dead, find no row to change.
"""

import random
from collections.abc import Collection
from dataclasses import dataclass, field, fields
from datetime import datetime, timedelta
from enum import StrEnum
from typing import Any

from sqlalchemy import ColumnElement, CursorResult, literal_column, select, update
from sqlalchemy.orm import InstrumentedAttribute, Session

from radiometry.findings import interface
from store.columns import new_id, utc_now
from store.tables import FrameRow, Job
from store.webhooks import EventName, announce

RETRIED_FOR = timedelta(days=1)
SHORTEST_PAUSE = timedelta(seconds=2)
LONGEST_PAUSE = timedelta(minutes=3)
FINAL_STATES = ("succeeded", "failed", "quarantined")
GIVEN_UP = ("failed", "quarantined")
PREVIEW_LANE = "look"
"""Of jobs that show a part of a frame; the others of their kind read the frame."""

IS_QUEUED = Job.state == literal_column("'queued'")
"""The condition as the index of queued jobs has it: SQLite compares the words."""

_CLAIM_ATTEMPTS = 8
"""How often a claim chooses again where other workers took what it had just seen."""


class Dependency(StrEnum):
    """A resource that a job needs, and may have to wait for."""

    DATABASE = "database"
    BLOBS = "blobs"
    DECODER = "decoder"

    @property
    def label(self) -> str:
        return {"database": "The database", "blobs": "The file store", "decoder": "The decoder"}[self]


class LeaseLost(Exception):  # noqa: N818  it is what happened, not a fault
    """Another worker holds the job now: whatever this one computed is dropped."""


@dataclass(frozen=True, kw_only=True)
class Claim:
    """The right to work on a job, until the lease ends or the fence rises."""

    job_id: str
    fence: int
    attempt: int
    kind: str
    organisation_id: str
    subject_id: str
    parameters: dict[str, Any]
    created_by: str
    faulty_since: datetime | None
    request_id: str | None
    traceparent: str | None


@dataclass
class Turn:
    """Where a worker's claims have come to on their way round the organisations, and the lanes of each."""

    organisation_id: str = ""
    lanes: dict[str, str] = field(default_factory=dict)
    """The lane that was served last, by organisation."""


def enqueue(
    session: Session,
    *,
    kind: str,
    subject_id: str,
    organisation_id: str,
    by: str,
    parameters: dict[str, Any],
    lane: str | None = None,
    is_new: bool = False,
) -> Job:
    """Return a queued job for this subject: one that already waits with the same parameters, or a new one.

    The lane is the job's kind unless another is named: what a person waits for does not stand in the lane of
    what a whole card or flight brings. ``is_new``: the subject is, and no job can wait for it.
    """
    waiting = select(Job).where(Job.subject_id == subject_id, Job.kind == kind, Job.state == "queued")
    for job in [] if is_new else session.scalars(waiting):
        if job.parameters == parameters:
            return job
    job = Job(
        id=new_id("job"),
        kind=kind,
        subject_id=subject_id,
        organisation_id=organisation_id,
        created_by=by,
        parameters=parameters,
        lane=lane or kind,
    )
    session.add(job)
    return job


def enqueue_extraction(
    session: Session,
    frame: FrameRow,
    organisation_id: str,
    *,
    by: str,
    is_new: bool = False,
    lane: str | None = None,
) -> Job:
    """Add a job that reads this frame, which may be new, and computes whatever its region still lacks."""
    return enqueue(
        session,
        kind="extract",
        subject_id=frame.id,
        organisation_id=organisation_id,
        by=by,
        parameters={},
        is_new=is_new,
        lane=lane,
    )


def is_live(session: Session, subject_id: str) -> bool:
    """Return True if a job for this subject waits or runs."""
    live = select(Job.id).where(Job.subject_id == subject_id, Job.state.in_(("queued", "running")))
    return session.scalar(live.limit(1)) is not None


def claim_next(
    session: Session, turn: Turn, *, lease_s: float, without: Collection[str] = ()
) -> Claim | None:
    """Take the next job that is due and not of the kinds ``without``; None when there is none.

    The organisation after the one that was served last comes first, then the lane after the one that was
    served last in it, then what has been due for longest: whoever brings one job waits for one of each other
    organisation at most, however many they have.
    """
    now = utc_now()
    ready = (Job.state == "queued") & (Job.due_at <= now)
    if without:
        ready &= Job.kind.not_in(without)
    for _ in range(_CLAIM_ATTEMPTS):
        organisation_id = _next_after(session, Job.organisation_id, turn.organisation_id, ready)
        if organisation_id is None:
            return None
        turn.organisation_id = organisation_id
        theirs = ready & (Job.organisation_id == organisation_id)
        lane = _next_after(session, Job.lane, turn.lanes.get(organisation_id, ""), theirs)
        if lane is None:
            continue
        turn.lanes[organisation_id] = lane
        first = select(Job.id).where(theirs, Job.lane == lane).order_by(Job.due_at).limit(1)
        # the state once more: between its two looks at the row PostgreSQL may see another's commit
        mine = (Job.id == first.with_for_update(skip_locked=True).scalar_subquery()) & (Job.state == "queued")
        claimed = (
            update(Job)
            .where(mine)
            .values(
                state="running",
                fence=Job.fence + 1,
                attempt=Job.attempt + 1,
                progress=0.0,
                waits_for=None,
                lease_until=now + timedelta(seconds=lease_s),
            )
        )
        columns = [getattr(Job, each.name) for each in fields(Claim) if each.name != "job_id"]
        if row := session.execute(claimed.returning(Job.id.label("job_id"), *columns)).mappings().first():
            return Claim(**row)
    return None


def _next_after(
    session: Session, column: InstrumentedAttribute[str], last: str, ready: ColumnElement[bool]
) -> str | None:
    """Return the column's next value after the last one among the jobs that are ready, else the first."""
    values = select(column).where(ready).order_by(column).limit(1)
    return session.scalar(values.where(column > last)) or session.scalar(values)


def renew(session: Session, held: Claim, *, lease_s: float, progress: float) -> None:
    """Extend the lease of a job, and store its progress, a fraction of 1."""
    _held(session, held, lease_until=utc_now() + timedelta(seconds=lease_s), progress=progress)


def give_back(session: Session, held: Claim) -> None:
    """Put a job back as if it had not been claimed: due at once, and for whoever comes first."""
    _held(session, held, state="queued", attempt=held.attempt - 1, progress=0.0, lease_until=None)


def succeed(session: Session, held: Claim, result: dict[str, Any]) -> None:
    """End a job, in the transaction that stores what it computed."""
    _held(
        session, held, state="succeeded", progress=1.0, result=result, lease_until=None, finished_at=utc_now()
    )
    _announce_end(session, held, "job.succeeded")


def fail(session: Session, held: Claim, error: dict[str, Any], traceback: str | None = None) -> None:
    """End a job that cannot succeed, with the reason."""
    _held(
        session,
        held,
        state="failed",
        error=error,
        traceback=traceback,
        lease_until=None,
        finished_at=utc_now(),
    )
    _announce_end(session, held, "job.failed", code=error.get("code"))


def retry_later(session: Session, held: Claim, *, waits_for: Dependency) -> None:
    """Put a job back after a passing fault; it has failed when such faults have lasted for a day.

    The pauses grow with the time since the first fault, up to minutes, and differ by chance: what failed
    together is not tried again together.
    """
    now = utc_now()
    since = held.faulty_since or now
    error = {"code": str(interface.TEMPORARILY_UNAVAILABLE), "retryable": True, "waits_for": str(waits_for)}
    if now - since >= RETRIED_FOR:
        detail = f"{waits_for.label} did not serve for a day. Nothing is lost: try the job again later."
        fail(session, held, error | {"detail": detail})
        return
    detail = f"{waits_for.label} did not serve. The job is retried automatically, for a day at most."
    pause = min(max((now - since) / 2, SHORTEST_PAUSE), LONGEST_PAUSE) * random.uniform(0.5, 1.0)  # noqa: S311
    _held(
        session,
        held,
        state="queued",
        error=error | {"detail": detail},
        lease_until=None,
        due_at=now + pause,
        faulty_since=since,
        waits_for=str(waits_for),
    )


def resume(session: Session, waits_for: Dependency) -> int:
    """Make the jobs due that wait for something that is back; return how many they were."""
    waiting = IS_QUEUED & (Job.waits_for == str(waits_for))
    return update_where(session, waiting, due_at=utc_now(), waits_for=None)


def retry(session: Session, chosen: ColumnElement[bool]) -> int:
    """Queue the chosen jobs that failed or were quarantined as if they had never been tried; how many."""
    return update_where(
        session,
        chosen & Job.state.in_(GIVEN_UP),
        state="queued",
        attempt=0,
        lost=0,
        progress=0.0,
        error=None,
        traceback=None,
        due_at=utc_now(),
        faulty_since=None,
        waits_for=None,
        finished_at=None,
        dismissed_at=None,
    )


def dismiss(session: Session, chosen: ColumnElement[bool], *, dismissed: bool) -> int:
    """Mark the chosen jobs that were given up as dismissed, or undo that; how many."""
    given_up = chosen & Job.state.in_(GIVEN_UP) & (Job.dismissed_at.is_(None) == dismissed)
    return update_where(session, given_up, dismissed_at=utc_now() if dismissed else None)


def _announce_end(session: Session, held: Claim, event: EventName, **more: Any) -> None:  # noqa: ANN401
    data = {"job_id": held.job_id, "kind": held.kind, "subject_id": held.subject_id, **more}
    announce(session, held.organisation_id, event, data)


def _held(session: Session, held: Claim, **values: Any) -> None:  # noqa: ANN401
    mine = (Job.id == held.job_id) & (Job.state == "running") & (Job.fence == held.fence)
    if not update_where(session, mine, **values):
        raise LeaseLost(held.job_id)


def update_where(session: Session, where: ColumnElement[bool], **values: Any) -> int:  # noqa: ANN401
    result = session.execute(update(Job).where(where).values(**values))
    assert isinstance(result, CursorResult)  # noqa: S101  narrows the type: an UPDATE has a row count
    return result.rowcount
