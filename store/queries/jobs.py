"""One organisation's jobs, for those who wait for them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, func, or_, select
from sqlalchemy.orm import Session

from store.columns import utc_now
from store.jobs import GIVEN_UP, PREVIEW_LANE
from store.queues import IS_QUEUED, LANES
from store.tables import Calibration, FrameRow, Job, Measurement

MOST_COUNTED = 2000
"""Jobs of a state are counted up to here: a summary of 100,000 jobs costs what one of a few thousand does."""


@dataclass(frozen=True, kw_only=True)
class Queue:
    counts: dict[str, int]
    """By state, at most `MOST_COUNTED` of each."""
    more: list[str]
    """States of which there are more than were counted."""
    oldest_wait_s: float


def summarise_queue(session: Session, organisation_id: str, states: Sequence[str]) -> Queue:
    some = [
        select(Job.id)
        .where(Job.organisation_id == organisation_id, Job.state == state)
        .limit(MOST_COUNTED + 1)
        .subquery()
        for state in states
    ]
    row = session.execute(
        select(*(select(func.count()).select_from(each).scalar_subquery() for each in some))
    ).one()
    counts = dict(zip(states, row, strict=True))
    return Queue(
        counts={state: min(count, MOST_COUNTED) for state, count in counts.items()},
        more=[state for state, count in counts.items() if count > MOST_COUNTED],
        oldest_wait_s=oldest_wait_s(session, organisation_id),
    )


@dataclass(frozen=True, kw_only=True)
class Cause:
    """Jobs that failed for one reason: of one state, kind, error code and campaign.

    Attributes
    ----------
    count : int
        How many jobs.
    newest : Job
        The one of them that was added last.
    """

    count: int
    newest: Job


def list_causes(session: Session, organisation_id: str) -> list[Cause]:
    """List why the newest jobs were given up, unless dismissed; the most frequent cause first."""
    code = Job.error["code"].as_string()
    theirs = (Job.organisation_id == organisation_id) & Job.dismissed_at.is_(None)
    newest = [
        select(Job.id).where(theirs, Job.state == state).order_by(Job.id.desc()).limit(MOST_COUNTED)
        for state in GIVEN_UP
    ]
    groups = (
        select(func.count(), func.max(Job.id))
        .outerjoin(FrameRow, FrameRow.id == Job.subject_id)
        .where(or_(*(Job.id.in_(select(each.subquery().c.id)) for each in newest)))
        .group_by(Job.state, Job.kind, code, func.coalesce(FrameRow.campaign_id, Job.subject_id))
    )
    counts = {row[1]: row[0] for row in session.execute(groups)}
    rows = session.scalars(select(Job).where(Job.id.in_(counts)))
    causes = [Cause(count=counts[row.id], newest=row) for row in rows]
    return sorted(causes, key=lambda cause: (-cause.count, cause.newest.id))


def select_given_up(
    organisation_id: str, *, state: str, kind: str | None, code: str | None, campaign_id: str | None
) -> ColumnElement[bool]:
    """Return which of an organisation's jobs are in a state, of a kind, ended by a code, of a campaign."""
    chosen = (Job.organisation_id == organisation_id) & (Job.state == state)
    if kind is not None:
        chosen &= Job.kind == kind
    if code is not None:
        chosen &= Job.error["code"].as_string() == code
    if campaign_id is not None:
        frames = select(FrameRow.id).where(FrameRow.campaign_id == campaign_id)
        chosen &= (Job.subject_id == campaign_id) | Job.subject_id.in_(frames)
    return chosen


def select_makers(made: Calibration | Measurement) -> ColumnElement[bool]:
    """Return which jobs made a version or a measurement; the same content made again is the same one."""
    if isinstance(made, Calibration):
        subject_id, kind, result = made.campaign_id, "fit", "calibration_id"
    else:
        subject_id, kind, result = made.frame_id, "measure", "measurement_id"
    named: ColumnElement[bool] = Job.result[result].as_string() == made.id
    return (Job.subject_id == subject_id) & (Job.kind == kind) & named


def find_reading_jobs(session: Session, frame_ids: Collection[str]) -> dict[str, str]:
    """Return the newest job that reads each frame, by the frame's id; previews do not count."""
    rows = (
        select(Job.subject_id, func.max(Job.id))
        .where(Job.subject_id.in_(frame_ids), Job.kind == "extract", Job.lane != PREVIEW_LANE)
        .group_by(Job.subject_id)
    )
    return {row[0]: row[1] for row in session.execute(rows)}


def frames_of(session: Session, jobs: Sequence[Job]) -> dict[str, FrameRow]:
    """The frames that jobs work on, by id."""
    ids = {job.subject_id for job in jobs}
    return {row.id: row for row in session.scalars(select(FrameRow).where(FrameRow.id.in_(ids)))}


def oldest_wait_s(session: Session, organisation_id: str | None = None) -> float:
    """How long the job that has waited longest has been due [s], of all or of one; 0 when none waits."""
    now = utc_now()
    first = select(Job.due_at).where(Job.due_at <= now).order_by(Job.due_at).limit(1)
    if organisation_id is None:
        found = [session.scalar(first.where(IS_QUEUED))]
    else:
        # lane by lane: each is a look into the index of what is sent next, however many jobs wait
        theirs = (Job.state == "queued") & (Job.organisation_id == organisation_id)
        found = [session.scalar(first.where(theirs, Job.lane == lane)) for lane in LANES]
    return max(((now - due_at).total_seconds() for due_at in found if due_at), default=0.0)
