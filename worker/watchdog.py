"""Liveness by work done: a worker that has stopped taking jobs while jobs wait ends, and is started anew.

Celery can stop consuming after a reconnect and look alive; no heartbeat of its own notices.
"""

import logging
import os
import threading
import time

from sqlalchemy.exc import SQLAlchemyError

from store import jobs
from store.database import Database
from worker.leases import Leases

log = logging.getLogger(__name__)

STALLED_EXIT = 70


class Watchdog:
    def __init__(self, database: Database, leases: Leases, stall_s: float) -> None:
        self._database = database
        self._leases = leases
        self._stall_s = stall_s
        self._last_work = time.monotonic()
        threading.Thread(target=self._watch, name="watchdog", daemon=True).start()

    def worked(self) -> None:
        """A hint has arrived."""
        self._last_work = time.monotonic()

    def _watch(self) -> None:
        pause = threading.Event()
        while not pause.wait(self._stall_s / 4):
            if self._leases.count:
                self.worked()
            elif time.monotonic() - self._last_work > self._stall_s and self._somebody_waits():
                log.error("jobs wait and no hint has come for %g s: starting anew", self._stall_s)
                os._exit(STALLED_EXIT)

    def _somebody_waits(self) -> bool:
        try:
            with self._database.reading() as session:
                return jobs.oldest_wait_s(session) > self._stall_s
        except SQLAlchemyError:
            return False
