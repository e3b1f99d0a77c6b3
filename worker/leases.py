"""The leases of the jobs that this process works on, and how far those have come."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

from store import jobs
from store.database import Database


class Leases:
    """A lease that could not be renewed is not pressed: the fence decides when the work is stored."""

    def __init__(self) -> None:
        self._held: dict[str, tuple[jobs.Claim, float]] = {}

    @contextmanager
    def hold(self, claim: jobs.Claim) -> Iterator[None]:
        self.report(claim, 0.0)
        try:
            yield
        finally:
            del self._held[claim.job_id]

    def report(self, claim: jobs.Claim, progress: float) -> None:
        """Note how far a job has come; it is written with the next renewal, so noting it costs nothing."""
        self._held[claim.job_id] = (claim, progress)

    def renew(self, database: Database, lease_s: float) -> None:
        """Renew the leases, and write down how far their jobs have come."""
        for claim, progress in list(self._held.values()):
            # lost: it has ended this very moment, which is usual; or another holds it, and its end finds that
            with suppress(jobs.LeaseLost), database.writing("worker") as session:
                jobs.renew(session, claim, lease_s=lease_s, progress=progress)
