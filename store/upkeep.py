"""Jobs that no message brings about: what is late or lost, or was written down by a clock that was set since.

A time that lies further ahead than any rule sets was written before the clock was set back: it would stand
for as long as the clock was ahead. And no lease ends because the clock was set forward, or the machine slept.
"""

import time
from collections.abc import Callable
from datetime import timedelta
from functools import cache
from typing import Final, NamedTuple

from sqlalchemy import Select, bindparam, false, or_, select, true, update
from sqlalchemy.orm import Session

from store.columns import UtcDateTime, utc_now
from store.queues import IS_QUEUED, LOST_AFTER_S, QUEUES, needs_files, of_queue
from store.reviews import is_stale
from store.tables import CampaignReview, Job
from store.webhooks import mend_due

_FURTHEST_DUE: Final = timedelta(minutes=5)
"""Further ahead than any pause before a job is tried again."""
_LEASES_AHEAD: Final = 3
"""Workers may have different leases in their settings."""
_JUMP_S: Final = 5.0


class ClockWatch:
    """Notices that the wall clock was set, or that the machine slept, since it was last asked."""

    def __init__(
        self, *, wall: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._wall = wall
        self._steady = steady
        self._ahead_s = wall() - steady()

    def jumped_s(self) -> float:
        """Return by how much the wall clock has jumped [s]; 0 for what a clock is trimmed by."""
        ahead_s = self._wall() - self._steady()
        jumped_s, self._ahead_s = ahead_s - self._ahead_s, ahead_s
        return jumped_s if abs(jumped_s) > _JUMP_S else 0.0


def mend_times(session: Session, *, lease_s: float, jumped: bool) -> None:
    """Bring times that no rule set within their rules, and renew every lease after a jump.

    A lease is shortened to a whole one from now, not ended: a worker that lives renews it in time.
    """
    now = utc_now()
    lease = timedelta(seconds=lease_s)
    too_long = true() if jumped else Job.lease_until > now + _LEASES_AHEAD * lease
    session.execute(update(Job).where(Job.state == "running", too_long).values(lease_until=now + lease))
    session.execute(update(Job).where(IS_QUEUED, Job.due_at > now + _FURTHEST_DUE).values(due_at=now))
    mend_due(session)


class Look(NamedTuple):
    unsent: bool
    """A job is due, and no message of its queue is on its way."""
    late: bool
    """A job was sent seconds ago and has not begun."""
    held_back: bool
    """Jobs wait until the file store serves."""
    stale: bool
    """The review of a campaign is stale and computed by no worker."""
    lost: bool
    """A lease has run out, or a time lies further ahead than any rule sets."""


def look(session: Session, *, lease_s: float) -> Look:
    """Return what is to be done; one statement, since each process of a worker asks every two seconds."""
    now = utc_now()
    instants = {
        "now": now,
        "late": now - timedelta(seconds=LOST_AFTER_S),
        "latest_lease": now + _LEASES_AHEAD * timedelta(seconds=lease_s),
        "latest_due": now + _FURTHEST_DUE,
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
    tried = due.where(Job.waits_for.is_not(None))
    unsent = [
        ~sent.where(of_queue(queue)).exists()
        & or_(
            due.where(of_queue(queue)).exists() & ~(held_back if needs_files(queue) else false()),
            tried.where(of_queue(queue)).exists(),
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
