"""Resources that a request needs, built once in main and passed down."""

from functools import cached_property
from typing import Annotated

from anyio import CapacityLimiter
from fastapi import Depends, Request

from radiometry.records import Record
from service.http import batches, connections, counts, processes, signatures
from service.jobs.watch import JobWatch
from service.system.health import Health
from store.blobs import Blobs
from store.blobs.partials import Partials
from store.database import Database
from store.files import Files
from store.queries.usage import Quotas
from store.reviews import Reviews
from store.settings import Settings


class Context(Record):
    settings: Settings
    database: Database
    blobs: Blobs
    watch: JobWatch
    sessions: signatures.Sessions
    traffic: processes.Traffic
    health: Health

    @cached_property
    def hosts(self) -> connections.Hosts:
        return connections.Hosts(self.settings)

    @cached_property
    def attempts(self) -> counts.Attempts:
        return counts.Attempts()

    @cached_property
    def refused(self) -> counts.Attempts:
        """Requests without a key that is known, of which many are answered late."""
        return counts.Attempts(free=50)

    @cached_property
    def quotas(self) -> Quotas:
        return Quotas.of(self.settings)

    @property
    def partials(self) -> Partials:
        return Partials.of(self.settings)

    @cached_property
    def rates(self) -> counts.Rates:
        return counts.Rates(self.settings.quota_requests_per_minute)

    @cached_property
    def reviews(self) -> Reviews:
        return Reviews(self.database)

    @cached_property
    def presses(self) -> CapacityLimiter:
        """How many certificates and plots are made at once, in threads that no other request waits for."""
        return CapacityLimiter(2)

    @cached_property
    def readers(self) -> CapacityLimiter:
        """Large bodies are read one at a time: between any two steps of one the loop gets its turn."""
        return CapacityLimiter(1)

    @cached_property
    def together(self) -> batches.Together:
        return batches.Together()

    @cached_property
    def uses(self) -> counts.Uses:
        return counts.Uses(self.database)

    @cached_property
    def signer(self) -> signatures.Signer:
        return signatures.Signer(signatures.read_seed(self.settings), self.database)

    @property
    def files(self) -> Files:
        return Files(self.database, self.blobs)


async def get_context(request: Request) -> Context:
    """Return what the application was put together around; FastAPI calls what is not async in a thread."""
    context: Context = request.app.state.context
    return context


UsesContext = Annotated[Context, Depends(get_context)]
