"""One organisation's jobs, for those who wait for them."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from store.jobs import oldest_wait_s
from store.tables import FrameRow, Job


@dataclass(frozen=True, kw_only=True)
class Queue:
    counts: dict[str, int]
    """By state."""
    oldest_wait_s: float


def summarise_queue(session: Session, organisation_id: str) -> Queue:
    rows = session.execute(
        select(Job.state, func.count()).where(Job.organisation_id == organisation_id).group_by(Job.state)
    )
    return Queue(
        counts={row[0]: row[1] for row in rows}, oldest_wait_s=oldest_wait_s(session, organisation_id)
    )


def frames_of(session: Session, jobs: Sequence[Job]) -> dict[str, FrameRow]:
    """The frames that jobs work on, by id."""
    ids = {job.subject_id for job in jobs}
    return {row.id: row for row in session.scalars(select(FrameRow).where(FrameRow.id.in_(ids)))}
