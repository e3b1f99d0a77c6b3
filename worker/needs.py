"""Resources that each kind of job needs, and which errors say that they do not serve."""

from datetime import datetime

from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from store.blobs import Blobs, StorageFull, StorageUnavailable
from store.jobs import Dependency
from worker.breaker import Breaker
from worker.decode.pool import DecoderUnavailable

DATABASE_AWAY = (OperationalError, InterfaceError, PoolTimeout)
_FAULTS: dict[Dependency, tuple[type[Exception], ...]] = {
    Dependency.DATABASE: DATABASE_AWAY,
    Dependency.BLOBS: (StorageUnavailable, StorageFull),
    Dependency.DECODER: (DecoderUnavailable,),
}
_READS_FRAMES = frozenset({"extract", "measure"})
"""The kinds of jobs that need the file store and a decoder; every kind needs the database."""


def find_dependency(error: Exception) -> Dependency | None:
    """Return what an error says does not serve; None for an error of ours."""
    return next((each for each, faults in _FAULTS.items() if isinstance(error, faults)), None)


class Needs:
    """The breakers of one worker. The database has none: where it is away there is nothing to claim."""

    def __init__(self, blobs: Blobs) -> None:
        # whether a decoder starts is seen only where a job starts one
        self._breakers = {
            Dependency.BLOBS: Breaker(Dependency.BLOBS, blobs.check, faults=_FAULTS[Dependency.BLOBS]),
            Dependency.DECODER: Breaker(Dependency.DECODER, lambda: None, faults=()),
        }

    def list_held_back(self) -> frozenset[str]:
        """Return the kinds of jobs that this thread must not begin now; it tells `choose` what it took."""
        permits = [breaker.permits() for breaker in self._breakers.values()]
        return frozenset() if all(permits) else _READS_FRAMES

    def choose(self, kind: str | None) -> None:
        """Note the kind of the job that this thread begins; None for no job."""
        if kind not in _READS_FRAMES:
            for breaker in self._breakers.values():
                breaker.withdraw()

    def fail(self, dependency: Dependency | None, error: Exception) -> None:
        """Note that this thread's job could not end; for want of a dependency, or by a fault of ours."""
        for each, breaker in self._breakers.items():
            if each is dependency:
                breaker.failed(error)
            else:
                breaker.withdraw()

    def serve(self, kind: str) -> list[Dependency]:
        """Note that this thread's job had what it needs; which dependencies it proved to be back."""
        if kind not in _READS_FRAMES:
            return []
        return [each for each, breaker in self._breakers.items() if breaker.served()]

    def list_away(self) -> dict[Dependency, datetime]:
        """Return what does not serve, and since when."""
        return {
            each: breaker.open_since
            for each, breaker in self._breakers.items()
            if breaker.open_since is not None
        }
