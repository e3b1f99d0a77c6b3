"""The life of a job: queued, claimed with a lease and a fence, finished once, or taken back and tried again.

Every step is one conditional UPDATE: two workers that hold the same hint, or a worker that comes back
from the dead, find no row to change.
"""

from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any

from sqlalchemy import ColumnElement, CursorResult, select, update
from sqlalchemy.orm import Session

from store.columns import new_id, utc_now
from store.tables import Job

QUARANTINE_AFTER = 3
RETRY_LIMIT = 8
_HINT_AGAIN_AFTER = timedelta(seconds=5)
FINAL_STATES = ("succeeded", "failed", "quarantined")


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


def enqueue(
    session: Session, *, kind: str, subject_id: str, organisation_id: str, by: str, parameters: dict[str, Any]
) -> Job:
    """A queued job for this subject: the one that already waits with the same parameters, or a new one."""
    waiting = session.scalars(
        select(Job).where(Job.subject_id == subject_id, Job.kind == kind, Job.state == "queued")
    )
    for job in waiting:
        if job.parameters == parameters:
            return job
    job = Job(
        id=new_id("job"),
        kind=kind,
        subject_id=subject_id,
        organisation_id=organisation_id,
        created_by=by,
        parameters=parameters,
        hinted_at=utc_now(),
    )
    session.add(job)
    return job


def is_live(session: Session, subject_id: str) -> bool:
    """Whether a job for this subject waits or runs."""
    live = select(Job.id).where(Job.subject_id == subject_id, Job.state.in_(("queued", "running")))
    return session.scalar(live.limit(1)) is not None


def claim(session: Session, job_id: str, *, lease_s: float) -> Claim | None:
    """Take a job that waits; None when it is gone, taken, finished or not yet due."""
    now = utc_now()
    taken = _update(
        session,
        (Job.id == job_id) & (Job.state == "queued") & (Job.due_at <= now),
        state="running",
        fence=Job.fence + 1,
        attempt=Job.attempt + 1,
        progress=0.0,
        lease_until=now + timedelta(seconds=lease_s),
    )
    if not taken:
        return None
    job = session.get_one(Job, job_id)
    return Claim(
        job_id=job.id,
        fence=job.fence,
        attempt=job.attempt,
        kind=job.kind,
        organisation_id=job.organisation_id,
        subject_id=job.subject_id,
        parameters=job.parameters,
        created_by=job.created_by,
    )


def renew(session: Session, held: Claim, *, lease_s: float, progress: float) -> None:
    """Hold on to a job for another lease, and say how far the work has come, as a share of 1."""
    _held(session, held, lease_until=utc_now() + timedelta(seconds=lease_s), progress=progress)


def succeed(session: Session, held: Claim, result: dict[str, Any]) -> None:
    """End a job, in the transaction that stores what it computed."""
    _held(
        session, held, state="succeeded", progress=1.0, result=result, lease_until=None, finished_at=utc_now()
    )


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


def retry_later(session: Session, held: Claim, error: dict[str, Any]) -> None:
    """Put a job back after a passing fault: later each time, and failed at last."""
    if held.attempt >= RETRY_LIMIT:
        fail(session, held, error)
        return
    due = utc_now() + timedelta(seconds=min(2.0**held.attempt, 60.0))
    _held(session, held, state="queued", error=error, lease_until=None, due_at=due, hinted_at=None)


def retry(session: Session, job_id: str) -> bool:
    """Queue a job that failed or was set aside as if it had never been tried; whether it was such a one."""
    now = utc_now()
    given_up = (Job.id == job_id) & Job.state.in_(("failed", "quarantined"))
    renewed = _update(
        session,
        given_up,
        state="queued",
        attempt=0,
        lost=0,
        progress=0.0,
        error=None,
        traceback=None,
        due_at=now,
        hinted_at=now,
        finished_at=None,
    )
    return renewed > 0


def sweep(session: Session) -> list[str]:
    """Take back what dead workers held; the ids of the jobs that wait for a hint."""
    now = utc_now()
    expired = (Job.state == "running") & (Job.lease_until < now)
    lost_error = {
        "code": "worker_lost",
        "detail": f"Its worker was lost {QUARANTINE_AFTER} times while it ran; it is set aside for a look.",
        "retryable": False,
    }
    _update(
        session,
        expired & (Job.lost + 1 >= QUARANTINE_AFTER),
        state="quarantined",
        lost=Job.lost + 1,
        error=lost_error,
        lease_until=None,
        finished_at=now,
    )
    _update(session, expired, state="queued", lost=Job.lost + 1, lease_until=None, due_at=now, hinted_at=None)
    waiting = list(
        session.scalars(
            select(Job.id)
            .where(Job.state == "queued", Job.due_at <= now)
            .where(Job.hinted_at.is_(None) | (Job.hinted_at < now - _HINT_AGAIN_AFTER))
            .order_by(Job.created_at)
            .limit(1000)
        )
    )
    _update(session, Job.id.in_(waiting), hinted_at=now)
    return waiting


def oldest_wait_s(session: Session, organisation_id: str | None = None) -> float:
    """How long the job that has waited longest has been due [s], of all or of one; 0 when none waits."""
    waiting = select(Job.due_at).where(Job.state == "queued", Job.due_at <= utc_now())
    if organisation_id is not None:
        waiting = waiting.where(Job.organisation_id == organisation_id)
    oldest: datetime | None = session.scalar(waiting.order_by(Job.due_at).limit(1))
    return (utc_now() - oldest).total_seconds() if oldest else 0.0


def _held(session: Session, held: Claim, **values: Any) -> None:  # noqa: ANN401
    mine = (Job.id == held.job_id) & (Job.state == "running") & (Job.fence == held.fence)
    if not _update(session, mine, **values):
        raise LeaseLost(held.job_id)


def _update(session: Session, where: ColumnElement[bool], **values: Any) -> int:  # noqa: ANN401
    result = session.execute(update(Job).where(where).values(**values))
    assert isinstance(result, CursorResult)  # noqa: S101  narrows the type: an UPDATE has a row count
    return result.rowcount
