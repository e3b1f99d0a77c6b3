"""Resources that a job needs, built once in main and passed down."""

from dataclasses import dataclass
from functools import cached_property

from store.blobs import Blobs
from store.database import Database
from store.durations import Durations
from store.files import Files
from store.reviews import Reviews
from store.settings import Settings
from worker.decode.pool import DecoderPool
from worker.leases import Leases
from worker.needs import Needs


@dataclass(frozen=True, kw_only=True)
class Context:
    settings: Settings
    database: Database
    blobs: Blobs
    decoders: DecoderPool
    leases: Leases
    needs: Needs

    @cached_property
    def durations(self) -> Durations:
        return Durations()

    @cached_property
    def reviews(self) -> Reviews:
        return Reviews(self.database)

    @property
    def files(self) -> Files:
        return Files(self.database, self.blobs)
