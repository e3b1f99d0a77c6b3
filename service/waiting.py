"""Waiting for a job to end, at the cost of one query a tick for all who wait together."""

import asyncio
from collections import Counter

from sqlalchemy import select
from starlette.concurrency import run_in_threadpool

from store.database import Database
from store.jobs import FINAL_STATES
from store.tables import Job

_TICK_S = 0.1


class JobWatch:
    """Holds no thread and no connection for anyone who waits; asks nothing while nobody does."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._waiting: Counter[str] = Counter()
        self._ended: set[str] = set()
        self._tick = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    async def wait(self, job_id: str, timeout_s: float) -> None:
        """Return when the job has ended, or when the time is over."""
        self._waiting[job_id] += 1
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._look())
        try:
            async with asyncio.timeout(timeout_s):
                while job_id not in self._ended:
                    await self._tick.wait()
        except TimeoutError:
            return
        finally:
            self._waiting[job_id] -= 1
            if not self._waiting[job_id]:
                del self._waiting[job_id]
                self._ended.discard(job_id)

    async def _look(self) -> None:
        while self._waiting:
            self._ended |= await run_in_threadpool(self._final, list(self._waiting))
            self._tick.set()
            self._tick = asyncio.Event()
            await asyncio.sleep(_TICK_S)

    def _final(self, job_ids: list[str]) -> set[str]:
        with self._database.reading() as session:
            return set(
                session.scalars(select(Job.id).where(Job.id.in_(job_ids), Job.state.in_(FINAL_STATES)))
            )
