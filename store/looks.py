"""Question of a worker without a job: one statement, since it is asked every two seconds."""

from datetime import timedelta
from functools import cache
from typing import NamedTuple

from sqlalchemy import Select, bindparam, or_, select
from sqlalchemy.orm import Session

from store.clocks import FURTHEST_DUE, LEASES_AHEAD
from store.columns import UtcDateTime, utc_now
from store.jobs import IS_QUEUED
from store.reviews import is_stale
from store.tables import CampaignReview, Job


class Look(NamedTuple):
    """Work that waits.

    Attributes
    ----------
    due : bool
        A job could be claimed.
    stale : bool
        The review of a campaign is stale and computed by no worker.
    lost : bool
        A lease has run out, or a time lies further ahead than any rule sets.
    """

    due: bool
    stale: bool
    lost: bool


def look(session: Session, *, lease_s: float) -> Look:
    """Return which work waits."""
    now = utc_now()
    instants = {
        "now": now,
        "latest_lease": now + LEASES_AHEAD * timedelta(seconds=lease_s),
        "latest_due": now + FURTHEST_DUE,
    }
    return Look(*session.execute(_select(), instants).one())


@cache
def _select() -> Select[bool, bool, bool]:
    """Build the statement, which takes longer than to execute it."""
    now, latest_lease, latest_due = (
        bindparam(name, type_=UtcDateTime) for name in ("now", "latest_lease", "latest_due")
    )
    running = Job.state == "running"
    return select(
        select(Job.id).where(IS_QUEUED, Job.due_at <= now).exists(),
        select(CampaignReview.campaign_id).where(is_stale(now)).exists(),
        or_(
            select(Job.id).where(running, ~Job.lease_until.between(now, latest_lease)).exists(),
            select(Job.id).where(IS_QUEUED, Job.due_at > latest_due).exists(),
        ),
    )
