"""Waiting for jobs and following jobs and campaigns, at the cost of one look a tick for all who wait."""

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError
from starlette.concurrency import run_in_threadpool

from radiometry.findings import interface
from radiometry.records import Record
from service.http.problems import Problem
from store.database import Database
from store.jobs import FINAL_STATES
from store.queries.organisations import Who, find_in_force
from store.tables import CampaignReview, Job

_TICK_S: Final = 0.1
_FOLLOWING_TICK_S: Final = 0.5
_LONGEST_TICK_S: Final = 2.0
_HEARTBEAT_S: Final = 15.0
"""So often something is sent: proxies close what is silent for a minute, and a lost peer is noticed."""
MOST_STREAMS: Final = 20

Kind = Literal["job", "campaign"]


class Event(Record):
    """The state of what is followed. Its id is the state's: who has seen it is not sent it again."""

    kind: str
    id: str
    data: dict[str, Any]
    final: bool = False


_REVOKED: Final = Event(kind="end", id="", data={"code": "unauthenticated"}, final=True)
_CROWDED: Final = Event(kind="end", id="", data={"code": "too_many_streams"}, final=True)
_GONE: Final = Event(kind="end", id="", data={"code": "service_stopping"}, final=True)


@dataclass(eq=False, kw_only=True)
class _Follower:
    kind: Kind
    subject_id: str
    who: Who | None  # none of who waits for a job alone, whose right is not asked for again
    seen: str = ""
    news: Event | None = None
    woken: asyncio.Event = field(default_factory=asyncio.Event)

    def tell(self, event: Event | None) -> None:
        if event is not None and (event.final or event.id != self.seen):
            self.news, self.seen = event, event.id
            self.woken.set()


class JobWatch:
    """Watch of jobs and campaigns: no thread or connection per waiting request, no query while none waits."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._followers: set[_Follower] = set()
        self._newcomer = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._released = False

    async def wait(self, job_id: str, timeout_s: float) -> None:
        """Return when the job has ended, when the time is over, or when nobody is to wait any more."""
        if self._released:
            return
        waiting = _Follower(kind="job", subject_id=job_id, who=None)
        with self._following(waiting), suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                while not self._released and not (waiting.news and waiting.news.final):
                    await waiting.woken.wait()
                    waiting.woken.clear()

    def admit(self, who: Who) -> None:
        """Refuse a stream beyond those that one key may have in this process."""
        if self._is_full(who):
            detail = f"This key follows {MOST_STREAMS} jobs and campaigns already. Close one first."
            raise Problem(interface.TOO_MANY_STREAMS, detail, headers={"Retry-After": "15"})

    def _is_full(self, who: Who) -> bool:
        mine = [each for each in self._followers if each.who and each.who.key_id == who.key_id]
        return len(mine) >= MOST_STREAMS

    async def follow(
        self, kind: Kind, subject_id: str, who: Who, *, seen: str = ""
    ) -> AsyncIterator[Event | None]:
        """Yield each new state, and None as a heartbeat, until the end of a job or of the caller's right."""
        if self._is_full(who):  # others were admitted at the same moment
            yield _CROWDED
            return
        with self._following(_Follower(kind=kind, subject_id=subject_id, who=who, seen=seen)) as follower:
            while not self._released:
                try:
                    await asyncio.wait_for(follower.woken.wait(), _HEARTBEAT_S)
                except TimeoutError:
                    yield None
                    continue
                follower.woken.clear()
                if follower.news is not None:
                    yield follower.news
                    if follower.news.final:
                        return
            yield _GONE

    def release(self) -> None:
        self._released = True
        for follower in self._followers:
            follower.woken.set()

    @contextmanager
    def _following(self, follower: _Follower) -> Iterator[_Follower]:
        self._followers.add(follower)
        if follower.who is not None:
            self._newcomer.set()
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._look())
        try:
            yield follower
        finally:
            self._followers.discard(follower)

    async def _look(self) -> None:
        tick_s = _TICK_S
        while self._followers:
            self._newcomer.clear()
            jobs = {each.subject_id for each in self._followers if each.kind == "job"}
            campaigns = {each.subject_id for each in self._followers if each.kind == "campaign"}
            callers = {each.who for each in self._followers if each.who}
            try:
                events, in_force = await run_in_threadpool(self._read, jobs, campaigns, callers)
                for each in self._followers:
                    is_refused = each.who in callers and each.who not in in_force
                    each.tell(_REVOKED if is_refused else events.get(each.subject_id))
                waiting = any(each.who is None for each in self._followers)
                tick_s = _TICK_S if waiting else _FOLLOWING_TICK_S
            except SQLAlchemyError:
                # Whoever waits is told when it is back; every other request says meanwhile that it is away.
                tick_s = min(2 * tick_s, _LONGEST_TICK_S)
            with suppress(TimeoutError):
                # who begins to follow is told the first state at once
                await asyncio.wait_for(self._newcomer.wait(), tick_s)

    def _read(
        self, jobs: set[str], campaigns: set[str], callers: set[Who]
    ) -> tuple[dict[str, Event], set[Who]]:
        """Return the state of each job and campaign, and whose keys and sessions are still in force."""
        events = {}
        with self._database.reading() as session:
            columns = Job.id, Job.state, Job.progress, Job.attempt
            for job_id, state, progress, attempt in session.execute(select(*columns).where(Job.id.in_(jobs))):
                data = {"id": job_id, "state": state, "progress": progress, "attempt": attempt}
                mark, final = f"{state}-{attempt}-{progress:g}", state in FINAL_STATES
                events[job_id] = Event(kind="job", id=mark, data=data, final=final)
            revisions = select(CampaignReview.campaign_id, CampaignReview.revision)
            for campaign_id, revision in session.execute(
                revisions.where(CampaignReview.campaign_id.in_(campaigns))
            ):
                data = {"id": campaign_id, "revision": revision}
                events[campaign_id] = Event(kind="campaign", id=str(revision), data=data)
            return events, find_in_force(session, callers) if callers else set()
