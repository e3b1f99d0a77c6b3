"""Question of a worker's upkeep: one statement, since it is asked every two seconds."""

from datetime import timedelta
from functools import cache
from typing import NamedTuple

from sqlalchemy import Select, bindparam, false, or_, select
from sqlalchemy.orm import Session

from store.clocks import FURTHEST_DUE, LEASES_AHEAD
from store.columns import UtcDateTime, utc_now
from store.queues import IS_QUEUED, LOST_AFTER_S, QUEUES, needs_files, of_queue
from store.reviews import is_stale
from store.tables import CampaignReview, Job


class Look(NamedTuple):
    """Tasks of the upkeep.

    Attributes
    ----------
    unsent : bool
        A job is due, and no message of its queue is on its way.
    late : bool
        A job was sent seconds ago and has not begun.
    held_back : bool
        Jobs wait until the file store serves.
    stale : bool
        The review of a campaign is stale and computed by no worker.
    lost : bool
        A lease has run out, or a time lies further ahead than any rule sets.
    """

    unsent: bool
    late: bool
    held_back: bool
    stale: bool
    lost: bool


def look(session: Session, *, lease_s: float) -> Look:
    """Return what is to be done."""
    now = utc_now()
    instants = {
        "now": now,
        "late": now - timedelta(seconds=LOST_AFTER_S),
        "latest_lease": now + LEASES_AHEAD * timedelta(seconds=lease_s),
        "latest_due": now + FURTHEST_DUE,
    }
    return Look(*session.execute(_select(), instants).one())


@cache
def _select() -> Select[bool, bool, bool, bool, bool]:
    """Build the statement, which takes longer than to execute it."""
    now, late, latest_lease, latest_due = (
        bindparam(name, type_=UtcDateTime) for name in ("now", "late", "latest_lease", "latest_due")
    )
    jobs, running = select(Job.id), Job.state == "running"
    held_back = jobs.where(IS_QUEUED, Job.waits_for == "blobs").exists()
    due = jobs.where(IS_QUEUED, Job.sent_at.is_(None), Job.due_at <= now)
    sent = jobs.where(IS_QUEUED, Job.sent_at.is_not(None))
    waits = due.where(Job.waits_for.is_not(None))
    unsent = [
        ~sent.where(of_queue(queue)).exists()
        & or_(
            due.where(of_queue(queue)).exists() & ~(held_back if needs_files(queue) else false()),
            waits.where(of_queue(queue)).exists(),
        )
        for queue in QUEUES
    ]
    return select(
        or_(*unsent),
        sent.where(~Job.sent_at.between(late, now)).exists(),
        held_back,
        select(CampaignReview.campaign_id).where(is_stale(now)).exists(),
        or_(
            jobs.where(running, ~Job.lease_until.between(now, latest_lease)).exists(),
            jobs.where(IS_QUEUED, Job.due_at > latest_due).exists(),
        ),
    )
