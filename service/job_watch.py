"""Waiting for a job to end, at the cost of one query a tick for all who wait together."""

import asyncio

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError
from starlette.concurrency import run_in_threadpool

from store.database import Database
from store.jobs import FINAL_STATES
from store.tables import Job

_TICK_S = 0.1
_LONGEST_TICK_S = 2.0


class JobWatch:
    """Watch of jobs: no thread or connection per waiting request, and no query while none waits."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._waiting: dict[str, set[asyncio.Future[None]]] = {}
        self._task: asyncio.Task[None] | None = None
        self._released = False

    async def wait(self, job_id: str, timeout_s: float) -> None:
        """Return when the job has ended, when the time is over, or when nobody is to wait any more."""
        if self._released:
            return
        told: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.setdefault(job_id, set()).add(told)
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._look())
        try:
            await asyncio.wait([told], timeout=timeout_s)
        finally:
            self._waiting[job_id].discard(told)
            if not self._waiting[job_id]:
                del self._waiting[job_id]

    def release(self) -> None:
        """Release all requests that wait, and those that will."""
        self._released = True
        self._tell(list(self._waiting))

    async def _look(self) -> None:
        tick_s = _TICK_S
        while self._waiting:
            try:
                self._tell(await run_in_threadpool(self._final, list(self._waiting)))
                tick_s = _TICK_S
            except SQLAlchemyError:
                # Whoever waits is told when it is back; every other request says meanwhile that it is away.
                tick_s = min(2 * tick_s, _LONGEST_TICK_S)
            await asyncio.sleep(tick_s)

    def _tell(self, job_ids: list[str]) -> None:
        for job_id in job_ids:
            for told in self._waiting.get(job_id, ()):
                if not told.done():
                    told.set_result(None)

    def _final(self, job_ids: list[str]) -> list[str]:
        with self._database.reading() as session:
            return list(
                session.scalars(select(Job.id).where(Job.id.in_(job_ids), Job.state.in_(FINAL_STATES)))
            )
