"""Resources that a job needs, built once in each process and passed down, and what comes of it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from sqlalchemy.orm import Session

from radiometry.findings import InputRejected, files
from store import jobs
from store.blobs import Blobs, StoredFile, blobs_from_url
from store.database import Database
from store.files import Files
from store.jobs import processes, queues
from store.reviews import Reviews
from store.settings import Settings
from worker.decode.pool import DecoderCrashed, DecoderPool


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
        for claim, progress in list(self._held.values()):
            # lost: it has ended this very moment, which is usual; or another holds it, and its end finds that
            with suppress(jobs.LeaseLost), database.writing("worker") as session:
                jobs.renew(session, claim, lease_s=lease_s, progress=progress)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """``store`` runs in the transaction that ends the job, perhaps twice, and returns the job's result."""

    store: Callable[[Session], dict[str, Any]]
    rejection: InputRejected | None = None


@dataclass(frozen=True, kw_only=True)
class Context:
    settings: Settings
    database: Database
    blobs: Blobs
    decoders: DecoderPool
    leases: Leases = field(default_factory=Leases)

    @cached_property
    def durations(self) -> processes.Durations:
        return processes.Durations()

    @cached_property
    def reviews(self) -> Reviews:
        return Reviews(self.database)

    @property
    def files(self) -> Files:
        return Files(self.database, self.blobs)

    @contextmanager
    def lend(self, sha256: str) -> Iterator[StoredFile]:
        """Lend a stored file to decode; only one that is whole is blamed where it ends its decoder."""
        try:
            with self.files.local(sha256) as file, self.decoders.hold(file):
                yield file
        except DecoderCrashed as crash:
            self.files.prove(sha256)
            raise InputRejected(files.DECODER_CRASHED, crash.message) from crash


def open_database(settings: Settings) -> Database:
    return Database(
        settings.effective_database_url,
        answer_within_s=settings.database_timeout_s,
        post=queues.Post(settings.effective_broker_url),
    )


def build_context(settings: Settings, decoders: DecoderPool, database: Database | None = None) -> Context:
    return Context(
        settings=settings,
        database=database or open_database(settings),
        blobs=blobs_from_url(settings.effective_blobs_url, settings.data),
        decoders=decoders,
    )
