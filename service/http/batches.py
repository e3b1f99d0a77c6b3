"""Requests that arrive together are committed together: a hundred requests may share what one commit costs.

Nobody waits for company. While a transaction is under way, the next requests of the same key gather, and the
following transaction takes all of them. Each is answered after the commit that it is in.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Final, TypeVar

from sqlalchemy.exc import IntegrityError, SQLAlchemyError
from starlette.concurrency import run_in_threadpool

MOST: Final = 100
"""Requests of one transaction."""

Item = TypeVar("Item")
Result = TypeVar("Result")
_Waiting = deque[tuple[Any, "asyncio.Future[Any]"]]


class Together:
    """Requests that wait for a transaction, by event loop and key; each in its loop's thread alone."""

    def __init__(self) -> None:
        self.waiting: dict[tuple[object, str], _Waiting] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    async def do(self, who: str, item: Item, act: Callable[[Sequence[Item]], Sequence[Result]]) -> Result:
        """Return what ``act`` answers for this item, which it may get together with others of ``who``."""
        loop = asyncio.get_running_loop()
        told: asyncio.Future[Result] = loop.create_future()
        waiting = self.waiting.get((loop, who))
        if waiting is not None:
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
