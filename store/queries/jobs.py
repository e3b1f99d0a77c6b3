"""One organisation's jobs, for those who wait for them."""

from collections.abc import Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, func, select
from sqlalchemy.orm import Session

from store.jobs import oldest_wait_s
from store.tables import FrameRow, Job

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


def frames_of(session: Session, jobs: Sequence[Job]) -> dict[str, FrameRow]:
    """The frames that jobs work on, by id."""
    ids = {job.subject_id for job in jobs}
    return {row.id: row for row in session.scalars(select(FrameRow).where(FrameRow.id.in_(ids)))}
