"""Resources that a request needs, built once in main and passed down."""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import cached_property
from typing import Annotated, Any, Final, TypeVar

from anyio import CapacityLimiter
from fastapi import Depends, Request
from sqlalchemy.exc import IntegrityError, SQLAlchemyError
from starlette.concurrency import run_in_threadpool

from radiometry.records import Record
from service.http import connections, counts, processes, signatures
from service.jobs.watch import JobWatch
from service.system.health import Health
from store.blobs import Blobs
from store.blobs.partials import Partials
from store.database import Database
from store.files import Files
from store.reviews import Reviews
from store.settings import Settings

MOST: Final = 100  # requests of one transaction

Item = TypeVar("Item")
Result = TypeVar("Result")
_Waiting = deque[tuple[Any, "asyncio.Future[Any]"]]


class Together:
    """Commits together what gathers of a key while a commit is under way: nobody waits for company."""

    def __init__(self) -> None:
        self.waiting: dict[tuple[object, str], _Waiting] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    async def do(self, who: str, item: Item, act: Callable[[Sequence[Item]], Sequence[Result]]) -> Result:
        """Return what ``act`` answers for this item, which it may get together with others of ``who``."""
        loop = asyncio.get_running_loop()
        told: asyncio.Future[Result] = loop.create_future()
        if (waiting := self.waiting.get((loop, who))) is not None:
            waiting.append((item, told))
        else:
            self.waiting[loop, who] = deque([(item, told)])
            # a task of its own: a request that is cut ends nobody else's
            task = asyncio.create_task(self._work((loop, who), act))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)
        return await told

    async def _work(self, key: tuple[object, str], act: Callable[[Sequence[Any]], Sequence[Any]]) -> None:
        waiting = self.waiting[key]
        try:
            while waiting:
                some = [waiting.popleft() for _ in range(min(MOST, len(waiting)))]
                results = await run_in_threadpool(_act, act, [item for item, _ in some])
                for (_, told), result in zip(some, results, strict=True):
                    if told.done():
                        continue
                    if isinstance(result, Exception):
                        told.set_exception(result)
                    else:
                        told.set_result(result)
        finally:
            del self.waiting[key]


def _act(act: Callable[[Sequence[Any]], Sequence[Any]], items: Sequence[Any]) -> Sequence[Any]:
    """Do all at once; if one of them cannot be done, each for itself, so that it alone is refused."""
    try:
        return act(items)
    except Exception as error:  # noqa: BLE001  each request raises its own
        away = isinstance(error, SQLAlchemyError) and not isinstance(error, IntegrityError)
        if away or len(items) == 1:
            return [error] * len(items)
    return [result for item in items for result in _act(act, [item])]


class Context(Record):
    settings: Settings
    database: Database
    blobs: Blobs
    watch: JobWatch
    sessions: signatures.Sessions
    traffic: processes.Traffic
    health: Health
    refused: counts.Attempts = field(default_factory=lambda: counts.Attempts(free=50))
    """Requests without a key that is known, of which many are answered late."""
    presses: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(2))
    """How many certificates and plots are made at once, in threads that no other request waits for."""
    readers: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(1))
    """Large bodies are read one at a time: between any two steps of one the loop gets its turn."""
    together: Together = field(default_factory=Together)

    @cached_property
    def hosts(self) -> connections.Hosts:
        return connections.Hosts(self.settings)

    @cached_property
    def attempts(self) -> counts.Attempts:
        return counts.Attempts()

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
