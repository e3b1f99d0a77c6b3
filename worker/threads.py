"""The threads that do the jobs: each takes the next one until none is left, then sleeps until it is woken."""

import logging
import os
import threading
import time
from collections.abc import Callable, Mapping
from datetime import datetime

from sqlalchemy.exc import SQLAlchemyError

from store.clocks import ClockWatch, mend_times, sweep
from store.database import summarise
from store.jobs import Claim, Dependency, Turn
from store.looks import look
from store.schema import OTHER_SCHEMA_EXIT, SchemaDiffers, require_own_schema
from worker.context import Context
from worker.needs import DATABASE_AWAY
from worker.runner import claim_next, run

log = logging.getLogger(__name__)

_LOOK_ENDS_S = 1.0
"""A look that waits for the database holds up no stop."""


class JobThreads:
    """A fixed number of threads over one context.

    A message wakes one of them, and whoever finds a job wakes the next: one message is enough for any number
    of jobs, and a message for a job that is done costs one look. A look every ``look_s`` finds what no
    message told of, and takes back what dead workers held.
    """

    def __init__(
        self,
        context: Context,
        *,
        count: int,
        look_s: float,
        looked: Callable[[], None],
        swept: Callable[[], None],
        noted: Callable[[Mapping[Dependency, datetime]], None],
    ) -> None:
        """``looked`` and ``swept`` are called after each look for jobs, and for lost ones.

        ``noted`` is called when other things serve than before.
        """
        self._context = context
        self._looked = looked
        self._swept = swept
        self._noted = noted
        self._wall = ClockWatch()
        self._renews = False
        self._turn = Turn()
        self._claiming = threading.Lock()
        self._away_since: float | None = None
        self._wakes = 0
        self._stopping = False
        self._ended = threading.Event()
        self._changed = threading.Condition()
        self._threads = [
            threading.Thread(target=self._work, name=f"jobs-{number}", daemon=True) for number in range(count)
        ]
        self._clock = threading.Thread(target=self._wake_every, args=[look_s], name="looks", daemon=True)

    def start(self) -> None:
        for thread in (*self._threads, self._clock):
            thread.start()

    def wake(self) -> None:
        """Wake one thread that sleeps, or the next that would, to take a job."""
        with self._changed:
            self._wakes = min(self._wakes + 1, len(self._threads))
            self._changed.notify()

    def stop(self, timeout_s: float) -> bool:
        """Begin no further job and wait for those that run; whether all of them have ended."""
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        self._ended.set()
        end = time.monotonic() + timeout_s
        for thread in self._threads:
            thread.join(max(0.0, end - time.monotonic()))
        self._clock.join(max(0.0, min(_LOOK_ENDS_S, end - time.monotonic())))
        return not any(thread.is_alive() for thread in self._threads)

    def _work(self) -> None:
        while not self._stopping:
            try:
                claim = self._claim()
                if claim is not None:
                    self.wake()
                    run(self._context, claim)
                    continue
                if self._review():
                    continue
            except SchemaDiffers as error:
                log.error("%s: this worker ends", error)  # noqa: TRY400  expected: no traceback
                os._exit(OTHER_SCHEMA_EXIT)
            except Exception:
                log.exception("a job was left to its lease, or none could be claimed")
            with self._changed:
                self._changed.wait_for(lambda: self._wakes or self._stopping)
                self._wakes -= 1

    def _review(self) -> bool:
        """Compute the review of a campaign that has changed; whether there was one."""
        try:
            return self._away_since is None and self._context.reviews.renew_next()
        except DATABASE_AWAY as error:
            log.warning("a review is left to others: %s", summarise(error))
            return False

    def _claim(self) -> Claim | None:
        # one at a time: the turn is shared, and so is SQLite's write lock
        with self._claiming:
            if self._stopping:
                return None
            try:
                claim = claim_next(self._context, self._turn)
            except DATABASE_AWAY as error:
                if self._away_since is None:
                    self._away_since = time.monotonic()
                    log.warning("the database does not serve; no job is begun: %s", summarise(error))
                return None
            finally:
                self._looked()
            if self._away_since is not None:
                log.warning("the database serves again after %.0f s", time.monotonic() - self._away_since)
                self._away_since = None
            return claim

    def _is_idle(self) -> bool:
        """Take back what dead workers held; return True if a thread would find nothing.

        A transaction that reads costs a fraction of a claim, and of a sweep.
        """
        database, lease_s = self._context.database, self._context.leases.lease_s
        if jumped_s := self._wall.jumped_s():
            log.warning("the clock has jumped by %+.0f s: every lease begins again", jumped_s)
            self._renews = True
        try:
            with database.reading() as session:
                require_own_schema(session)
                found = look(session, lease_s=lease_s)
            lost = self._renews or found.lost
            if lost:
                # what this worker works on is not lost, however late it is
                self._context.leases.renew()
                with database.writing("sweeper") as session:
                    mend_times(session, lease_s=lease_s, jumped=self._renews)
                    sweep(session)
        except SQLAlchemyError:
            # while the database is away nobody can renew a lease
            self._renews = True
            return False
        self._renews = False
        return not (found.due or found.stale or lost)

    def _wake_every(self, seconds: float) -> None:
        # what is away before the first look is news, too
        away: Mapping[Dependency, datetime] = {}
        while not self._ended.wait(seconds):
            if self._is_idle():
                self._looked()
            else:
                self.wake()
            self._swept()
            before, away = away, self._context.needs.list_away()
            if away != before:
                self._noted(away)
