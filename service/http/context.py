"""Resources that a request needs, built once in main and passed down."""

from functools import cached_property
from typing import Annotated

from anyio import CapacityLimiter
from fastapi import Depends, Request

from radiometry.records import Record
from service.http.batches import Together
from service.http.connections import Hosts
from service.http.counts import Attempts, Rates, Uses
from service.http.processes import Traffic
from service.http.signatures import Sessions, Signer, read_seed
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
    sessions: Sessions
    traffic: Traffic
    health: Health

    @cached_property
    def hosts(self) -> Hosts:
        return Hosts(self.settings)

    @cached_property
    def attempts(self) -> Attempts:
        return Attempts()

    @cached_property
    def refused(self) -> Attempts:
        """Requests without a key that is known, of which many are answered late."""
        return Attempts(free=50)

    @cached_property
    def quotas(self) -> Quotas:
        return Quotas.of(self.settings)

    @property
    def partials(self) -> Partials:
        return Partials.of(self.settings)

    @cached_property
    def rates(self) -> Rates:
        return Rates(self.settings.quota_requests_per_minute)

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
    def together(self) -> Together:
        return Together()

    @cached_property
    def uses(self) -> Uses:
        return Uses(self.database)

    @cached_property
    def signer(self) -> Signer:
        return Signer(read_seed(self.settings), self.database)

    @property
    def files(self) -> Files:
        return Files(self.database, self.blobs)


async def get_context(request: Request) -> Context:
    """Return what the application was put together around; FastAPI calls what is not async in a thread."""
    context: Context = request.app.state.context
    return context


UsesContext = Annotated[Context, Depends(get_context)]
