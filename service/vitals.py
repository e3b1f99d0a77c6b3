"""Whether the service can still work: its loop turns, a thread is free, the database takes a write."""

import asyncio
import time

from starlette.concurrency import run_in_threadpool

from store.parts import Presence

_LOOK_EVERY_S = 5.0


class Vitals:
    """Goes the way of a request, every few seconds: through the loop and a thread, to the database."""

    def __init__(self, presence: Presence) -> None:
        self._presence = presence
        self._worked = time.monotonic()

    async def keep(self) -> None:
        while True:
            await run_in_threadpool(self._presence.beat)
            self._worked = time.monotonic()
            await asyncio.sleep(_LOOK_EVERY_S)

    @property
    def silent_s(self) -> float:
        """How long ago a thread was last free to work [s]."""
        return time.monotonic() - self._worked
