"""The leases of the jobs that this process works on, renewed while it does."""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from sqlalchemy.exc import SQLAlchemyError

from store import jobs
from store.awake import AwakeClock
from store.database import Database, summarise

log = logging.getLogger(__name__)


class Leases:
    """One thread renews them all, three times a lease; with each it says how far the work has come.

    A lease that could not be renewed is not pressed: the fence decides when the work is stored. Nor is that
    of a job that has come no further for a long time: it hangs, and another worker may fare better.
    """

    def __init__(self, database: Database, lease_s: float, *, stuck_s: float = 900.0) -> None:
        self._database = database
        self.lease_s = lease_s
        self._stuck_s = stuck_s
        self._clock = AwakeClock(lease_s)
        self._held: dict[str, tuple[jobs.Claim, float, float]] = {}
        self._lock = threading.Lock()
        threading.Thread(target=self._keep, name="leases", daemon=True).start()

    @contextmanager
    def hold(self, claim: jobs.Claim) -> Iterator[None]:
        self.report(claim, 0.0)
        try:
            yield
        finally:
            with self._lock:
                del self._held[claim.job_id]

    def report(self, claim: jobs.Claim, progress: float) -> None:
        """Note how far a job has come; it is written with the next renewal, so noting it costs nothing."""
        with self._lock:
            self._held[claim.job_id] = (claim, progress, self._clock.now_s)

    def give_back(self) -> None:
        """Return jobs that this process will not end, so that others take them at once."""
        with self._lock:
            held = list(self._held.values())
        for claim, _, _ in held:
            try:
                with self._database.writing("worker") as session:
                    jobs.give_back(session, claim)
                log.info("%s is given back", claim.job_id)
            except jobs.LeaseLost:
                continue
            except SQLAlchemyError as error:
                log.warning("%s is left to its lease: %s", claim.job_id, summarise(error))

    @property
    def count(self) -> int:
        """Return how many jobs come further."""
        return len(self._moving())

    def _moving(self) -> list[tuple[jobs.Claim, float]]:
        with self._lock:
            return [
                (claim, progress)
                for claim, progress, at_s in self._held.values()
                if self._clock.now_s - at_s <= self._stuck_s
            ]

    def _keep(self) -> None:
        pause, away = threading.Event(), False
        while not pause.wait(self.lease_s / 3):
            self._clock.turn()
            try:
                if self.renew() and away:
                    away = False
                    log.warning("leases are renewed again")
            except SQLAlchemyError as error:
                # said once, not for each job and round: the next sweep renews what nobody could renew
                if not away:
                    away = True
                    log.warning("no lease can be renewed: %s", summarise(error))

    def renew(self) -> int:
        """Renew the leases of the jobs that come further; return how many they are."""
        moving = self._moving()
        for claim, progress in moving:
            # lost: it has ended this very moment, which is usual; or another holds it, and its end finds that
            with suppress(jobs.LeaseLost), self._database.writing("worker") as session:
                jobs.renew(session, claim, lease_s=self.lease_s, progress=progress)
        return len(moving)
