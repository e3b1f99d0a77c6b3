"""Resources that a job needs, built once in each process and passed down."""

from dataclasses import dataclass, field
from functools import cached_property

from store.blobs import Blobs, blobs_from_url
from store.database import Database
from store.files import Files
from store.jobs.processes import Durations
from store.jobs.queues import Post
from store.reviews import Reviews
from store.settings import Settings
from worker.decode.pool import DecoderLimits, DecoderPool
from worker.leases import Leases


@dataclass(frozen=True, kw_only=True)
class Context:
    settings: Settings
    database: Database
    blobs: Blobs
    decoders: DecoderPool
    leases: Leases = field(default_factory=Leases)

    @cached_property
    def durations(self) -> Durations:
        return Durations()

    @cached_property
    def reviews(self) -> Reviews:
        return Reviews(self.database)

    @property
    def files(self) -> Files:
        return Files(self.database, self.blobs)


def make_decoders(settings: Settings) -> DecoderPool:
    return DecoderPool(
        DecoderLimits(
            memory_bytes=settings.decoder_memory_bytes,
            cpu_seconds=settings.decoder_cpu_s,
            wall_seconds=settings.decoder_wall_s,
        )
    )


def build_context(settings: Settings, decoders: DecoderPool) -> Context:
    """Open the world that the settings name."""
    return Context(
        settings=settings,
        database=Database(
            settings.effective_database_url,
            answer_within_s=settings.database_timeout_s,
            post=Post(settings.effective_broker_url),
        ),
        blobs=blobs_from_url(settings.effective_blobs_url, settings.data),
        decoders=decoders,
    )
