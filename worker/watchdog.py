"""Liveness by work done: a worker that no longer looks for jobs while jobs wait ends, and is restarted.

What shows that work goes on is noted by the threads that do it; the thread here only looks, and writes it
down.
"""

import logging
import os
import threading

from sqlalchemy.exc import SQLAlchemyError

from store.awake import AwakeClock
from store.database import Database
from store.parts import Presence
from store.pulse import Pulse
from store.queries.jobs import oldest_wait_s
from worker.leases import Leases

log = logging.getLogger(__name__)

STALLED_EXIT = 70
_LOOK_EVERY_S = 5.0


class Watchdog:
    """Watch of a stall: several checks in each limit; the time in which it was stopped does not count."""

    def __init__(
        self, database: Database, leases: Leases, presence: Presence, pulse: Pulse, *, stall_s: float
    ) -> None:
        self._database = database
        self._leases = leases
        self._presence = presence
        self._pulse = pulse
        self._stall_s = stall_s
        self._every_s = min(stall_s / 4, _LOOK_EVERY_S)
        self._clock = AwakeClock(2 * self._every_s)
        self._worked_s = self._swept_s = self._clock.now_s
        threading.Thread(target=self._watch, name="watchdog", daemon=True).start()

    def worked(self) -> None:
        """Note that a thread has looked for a job."""
        self._worked_s = self._clock.now_s

    def swept(self) -> None:
        """Note that what dead workers held was looked for."""
        self._swept_s = self._clock.now_s

    def _watch(self) -> None:
        pause, beaten_s = threading.Event(), 0.0
        while not pause.wait(self._every_s):
            now_s = self._clock.turn()
            if self._leases.count:
                self._worked_s = now_s
            both_s = min(self._worked_s, self._swept_s)
            if both_s > beaten_s:
                self._pulse.beat()
                beaten_s = both_s
            self._presence.beat(worked_s_ago=now_s - both_s)
            if now_s - self._worked_s > self._stall_s and self._somebody_waits():
                log.error("jobs wait and no thread has looked for one for %g s: restarting", self._stall_s)
                os._exit(STALLED_EXIT)

    def _somebody_waits(self) -> bool:
        try:
            with self._database.reading() as session:
                return oldest_wait_s(session) > self._stall_s
        except SQLAlchemyError:
            return False
