"""Where look-ups run: they must wait neither for a thread nor for one another."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from typing import Final

from service.uses import STEP
from store.database import Database
from store.ready.lookups import Found, Lookups

_THREADS: Final = 8


class LookupDesk:
    """Runs look-ups: on SQLite in the event loop, as they never wait there; else in threads."""

    def __init__(self, database: Database) -> None:
        self._lookups = Lookups(database, used_within=STEP)
        self._threads = None if database.is_sqlite else ThreadPoolExecutor(_THREADS, "look-up")

    async def find(
        self, secret: str, camera_id: str, method: str, *, at: datetime | None, known_at: datetime | None
    ) -> Found | None:
        """Return what is in force for whoever has this key; None where the usual way must say why not."""

        def find() -> Found | None:
            return self._lookups.find(secret, camera_id=camera_id, method=method, at=at, known_at=known_at)

        if self._threads is None:
            return find()
        return await asyncio.get_running_loop().run_in_executor(self._threads, find)
