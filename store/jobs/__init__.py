"""The life of a job: queued, begun with a lease and a fence, finished once, or taken back and tried again."""

import os
import random
import socket
from collections.abc import Collection
from dataclasses import fields
from datetime import datetime, timedelta
from enum import StrEnum
from typing import Any

from sqlalchemy import ColumnElement, select
from sqlalchemy.orm import Session

from radiometry.findings import interface
from radiometry.records import Record
from store.jobs.queues import IS_QUEUED, LANES, is_held_back, touch
from store.pulse import is_running
from store.queries import update_where
from store.tables import FrameRow, Job, new_id, utc_now

RETRIED_FOR = timedelta(days=1)
SHORTEST_PAUSE = timedelta(seconds=2)
LONGEST_PAUSE = timedelta(minutes=3)
FINAL_STATES = ("succeeded", "failed", "quarantined")
GIVEN_UP = ("failed", "quarantined")
PREVIEW_LANE = "look"  # of jobs that show a part of a frame; the others of their kind read the frame

QUARANTINE_AFTER = 3


class Dependency(StrEnum):
    DATABASE = "database"
    BLOBS = "blobs"
    DECODER = "decoder"
    BROKER = "broker"

    @property
    def label(self) -> str:
        return "The file store" if self is Dependency.BLOBS else f"The {self}"


class LeaseLost(Exception):  # noqa: N818  it is what happened, not a fault
    """Another worker holds the job now: whatever this one computed is dropped."""


class Claim(Record):
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

    ``lane``: else the job's kind. ``is_new``: the subject is, and no job can wait for it.
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
    touch(session, LANES[job.lane].queue)
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
    live = select(Job.id).where(Job.subject_id == subject_id, Job.state.in_(("queued", "running")))
    return session.scalar(live.limit(1)) is not None


def begin(session: Session, job_id: str, *, lease_s: float) -> Claim | None:
    """Take the job that a message names; None if it is not to be begun, or others have begun it."""
    if (job := session.get(Job, job_id, with_for_update=True, populate_existing=True)) is None:
        return None
    queue = LANES[job.lane].queue
    if job.waits_for != Dependency.BLOBS:  # until it knows whether the file store serves, no other is sent
        touch(session, queue)
    if job.state == "running" and _is_dead(job.holder):
        take_back(session, Job.id == job_id)
        session.refresh(job)
    if job.state != "queued":
        return None
    now, job.sent_at = utc_now(), None
    if job.due_at > now or (job.waits_for is None and is_held_back(session, queue)):
        return None
    job.state, job.progress, job.waits_for, job.holder = "running", 0.0, None, name_holder(os.getpid())
    job.fence += 1
    job.attempt += 1
    job.lease_until = now + timedelta(seconds=lease_s)
    session.flush()
    return Claim(job_id=job_id, **{each.name: getattr(job, each.name) for each in fields(Claim)[1:]})


def name_holder(pid: int) -> str:
    return f"{socket.gethostname()}:{pid}"


def _is_dead(holder: str | None) -> bool:
    """Return True if a process of this machine is gone; of another's nothing is known but the lease."""
    host, _, pid = (holder or "").rpartition(":")
    return host == socket.gethostname() and not is_running(int(pid))


def renew(session: Session, held: Claim, *, lease_s: float, progress: float) -> None:
    _held(session, held, lease_until=utc_now() + timedelta(seconds=lease_s), progress=progress)


def give_back(session: Session, pids: Collection[int]) -> int:
    """Put back what dead processes of this machine ran, as if it had not been begun; how many."""
    theirs = (Job.state == "running") & Job.holder.in_([name_holder(pid) for pid in pids])
    return _requeue(session, theirs, attempt=Job.attempt - 1)


def take_back(session: Session, lost: ColumnElement[bool]) -> int:
    """Take back jobs whose workers were lost; how many wait again. The others have lost too many."""
    now, lost = utc_now(), lost & (Job.state == "running")
    detail = f"Its worker was lost {QUARANTINE_AFTER} times while it ran."
    error = {"code": str(interface.WORKER_LOST), "detail": detail, "retryable": False}
    ended = {"state": "quarantined", "error": error, "lease_until": None, "finished_at": now}
    update_where(session, Job, lost & (Job.lost + 1 >= QUARANTINE_AFTER), lost=Job.lost + 1, **ended)
    return _requeue(session, lost, lost=Job.lost + 1)


def _requeue(session: Session, which: ColumnElement[bool], **values: Any) -> int:  # noqa: ANN401
    touch(session)
    again = {"state": "queued", "sent_at": None, "lease_until": None, "progress": 0.0, "due_at": utc_now()}
    return update_where(session, Job, which, **again, **values)


def succeed(session: Session, held: Claim, result: dict[str, Any]) -> None:
    """End a job, in the transaction that stores what it computed."""
    _end(session, held, state="succeeded", progress=1.0, result=result)


def fail(session: Session, held: Claim, error: dict[str, Any], traceback: str | None = None) -> None:
    _end(session, held, state="failed", error=error, traceback=traceback)


def retry_later(
    session: Session, held: Claim, *, waits_for: Dependency, alone: bool = False
) -> datetime | None:
    """Put a job back after a passing fault; return when it is due, None if such faults last for a day.

    ``alone``: others have what they need. Pauses differ by chance: what failed together is tried apart.
    """
    now = utc_now()
    since = held.faulty_since or now
    error = {"code": str(interface.TEMPORARILY_UNAVAILABLE), "retryable": True, "waits_for": str(waits_for)}
    if now - since >= RETRIED_FOR:
        detail = f"{waits_for.label} did not serve for a day. Nothing is lost: try the job again later."
        fail(session, held, error | {"detail": detail})
        return None
    detail = f"{waits_for.label} did not serve. The job is retried automatically, for a day at most."
    pause = min(max((now - since) / 2, SHORTEST_PAUSE), LONGEST_PAUSE) * random.uniform(0.5, 1.0)  # noqa: S311
    later = {"due_at": now + pause, "faulty_since": since, "waits_for": None if alone else str(waits_for)}
    _held(session, held, state="queued", error=error | {"detail": detail}, lease_until=None, **later)
    return now + pause


def resume(session: Session, waits_for: Dependency) -> int:
    """Make the jobs due that wait for something that is back; return how many they were."""
    waiting = IS_QUEUED & (Job.waits_for == str(waits_for))
    touch(session)
    return update_where(session, Job, waiting, due_at=utc_now(), waits_for=None)


def retry(session: Session, chosen: ColumnElement[bool]) -> int:
    """Queue the chosen jobs that failed or were quarantined as if they had never been tried; how many."""
    gone = dict.fromkeys(("error", "traceback", "faulty_since", "waits_for", "finished_at", "dismissed_at"))
    return _requeue(session, chosen & Job.state.in_(GIVEN_UP), attempt=0, lost=0, **gone)


def cancel(session: Session, job_id: str) -> None:
    """End a job that an operator has revoked, unless it has ended; whoever runs it can store nothing."""
    job = session.get(Job, job_id, with_for_update=True, populate_existing=True)
    if job is None or job.state in FINAL_STATES:
        return
    detail = "The operator has cancelled this job. It can be tried again."
    job.state, job.finished_at, job.lease_until = "failed", utc_now(), None
    job.error = {"code": str(interface.JOB_CANCELLED), "detail": detail, "retryable": False}
    job.fence += 1
    touch(session, LANES[job.lane].queue)


def dismiss(session: Session, chosen: ColumnElement[bool], *, dismissed: bool) -> int:
    """Mark the chosen jobs that were given up as dismissed, or undo that; how many."""
    given_up = chosen & Job.state.in_(GIVEN_UP) & (Job.dismissed_at.is_(None) == dismissed)
    return update_where(session, Job, given_up, dismissed_at=utc_now() if dismissed else None)


def _end(session: Session, held: Claim, **values: Any) -> None:  # noqa: ANN401
    _held(session, held, lease_until=None, finished_at=utc_now(), **values)


def _held(session: Session, held: Claim, **values: Any) -> None:  # noqa: ANN401
    mine = (Job.id == held.job_id) & (Job.state == "running") & (Job.fence == held.fence)
    if not update_where(session, Job, mine, **values):
        raise LeaseLost(held.job_id)
