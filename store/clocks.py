"""Clocks that are set, with what was written down by the time before.

A lease or a time to try again that lies further ahead than any rule sets was written before the clock was set
back: it would stand for as long as the clock was ahead. And no lease ends because the clock was set forward,
or because the whole machine slept: their workers had no time to renew them.
"""

import time
from collections.abc import Callable
from datetime import timedelta

from sqlalchemy import true, update
from sqlalchemy.orm import Session

from store.columns import utc_now
from store.queues import IS_QUEUED, touch
from store.tables import Job
from store.webhooks import mend_due

FURTHEST_DUE = timedelta(minutes=5)
"""Further ahead than any pause before a job is tried again."""
LEASES_AHEAD = 3
"""Workers may have different leases in their settings."""
_JUMP_S = 5.0


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
    too_long = true() if jumped else Job.lease_until > now + LEASES_AHEAD * lease
    session.execute(update(Job).where(Job.state == "running", too_long).values(lease_until=now + lease))
    session.execute(update(Job).where(IS_QUEUED, Job.due_at > now + FURTHEST_DUE).values(due_at=now))
    mend_due(session)
    touch(session)
