"""Jobs that no message brings about: what is late or lost, or was written down by a clock that was set since.

A time that lies further ahead than any rule sets was written before the clock was set back: it would stand
for as long as the clock was ahead. And no lease ends because the clock was set forward, or the machine slept.
"""

import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from datetime import timedelta
from functools import cache
from typing import Final, NamedTuple

from sqlalchemy import Select, bindparam, false, or_, select, true, update
from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from store import pulse, reviews
from store.database import SchemaDiffers, require_own_schema, summarise
from store.jobs import Dependency, processes, queues, resume, take_back
from store.tables import CampaignReview, Job, UtcDateTime, utc_now
from worker.context import Context
from worker.runner import serves

_LOOKS_A_LEASE: Final = 10
_FURTHEST_DUE: Final = timedelta(minutes=5)  # further ahead than any pause before a job is tried again
_LEASES_AHEAD: Final = 3  # workers may have different leases in their settings
_JUMP_S: Final = 5.0


class ClockWatch:
    """Notices that the wall clock was set, or that the machine slept, since it was last asked."""

    def __init__(
        self, *, wall: Callable[[], float] = time.time, steady: Callable[[], float] = time.monotonic
    ) -> None:
        self._wall, self._steady = wall, steady
        self._ahead_s = wall() - steady()

    def jumped_s(self) -> float:
        """Return by how much the wall clock has jumped [s]; 0 for what a clock is trimmed by."""
        ahead_s = self._wall() - self._steady()
        jumped_s, self._ahead_s = ahead_s - self._ahead_s, ahead_s
        return jumped_s if abs(jumped_s) > _JUMP_S else 0.0


def mend_times(session: Session, *, lease_s: float, jumped: bool) -> None:
    """Bring times that no rule set within their rules, and renew every lease after a jump."""
    now = utc_now()
    lease = timedelta(seconds=lease_s)
    too_long = true() if jumped else Job.lease_until > now + _LEASES_AHEAD * lease
    session.execute(update(Job).where(Job.state == "running", too_long).values(lease_until=now + lease))
    session.execute(update(Job).where(queues.IS_QUEUED, Job.due_at > now + _FURTHEST_DUE).values(due_at=now))


class Look(NamedTuple):
    unsent: bool  # a job is due, and no message of its queue is on its way
    late: bool  # a job was sent seconds ago and has not begun
    held_back: bool  # jobs wait until the file store serves
    stale: bool  # the review of a campaign is stale and computed by no worker
    lost: bool  # a lease has run out, or a time lies further ahead than any rule sets


def look(session: Session, *, lease_s: float) -> Look:
    """Return what is to be done; one statement, since each process of a worker asks every few seconds."""
    now = utc_now()
    instants = {
        "now": now,
        "late": now - timedelta(seconds=queues.LOST_AFTER_S),
        "latest_lease": now + _LEASES_AHEAD * timedelta(seconds=lease_s),
        "latest_due": now + _FURTHEST_DUE,
    }
    return Look(*session.execute(_select(), instants).one())


@cache
def _select() -> Select[bool, bool, bool, bool, bool]:
    """Build the statement, which takes longer than to execute it."""
    now, late, latest_lease, latest_due = (
        bindparam(name, type_=UtcDateTime) for name in ("now", "late", "latest_lease", "latest_due")
    )
    jobs, running = select(Job.id), Job.state == "running"
    held_back = jobs.where(queues.IS_QUEUED, Job.waits_for == "blobs").exists()
    due = jobs.where(queues.IS_QUEUED, Job.sent_at.is_(None), Job.due_at <= now)
    sent = jobs.where(queues.IS_QUEUED, Job.sent_at.is_not(None))
    tried = due.where(Job.waits_for.is_not(None))
    unsent = [
        ~sent.where(queues.of_queue(queue)).exists()
        & or_(
            due.where(queues.of_queue(queue)).exists()
            & ~(held_back if queues.needs_files(queue) else false()),
            tried.where(queues.of_queue(queue)).exists(),
        )
        for queue in queues.QUEUES
    ]
    return select(
        or_(*unsent),
        sent.where(~Job.sent_at.between(late, now)).exists(),
        held_back,
        select(CampaignReview.campaign_id).where(reviews.is_stale(now)).exists(),
        or_(
            jobs.where(running, ~Job.lease_until.between(now, latest_lease)).exists(),
            jobs.where(queues.IS_QUEUED, Job.due_at > latest_due).exists(),
        ),
    )


log = logging.getLogger(__name__)


class Upkeep:
    """A look for what no message brings about: the leader takes one often, the others a third as often."""

    def __init__(self, context: Context, presence: processes.Presence, *, lead: Callable[[], None]) -> None:
        """``lead`` begins, once, what one process of all workers is enough for."""
        self._context, self._presence, self._lead = context, presence, lead
        self._leads = self._renews = False
        self._away: dict[str, str] = {}
        self._wall = ClockWatch()
        self._renewed_at = 0.0
        self._away_since: float | None = None
        self._ended = threading.Event()

    def start(self) -> None:
        threading.Thread(target=self._keep, name="upkeep", daemon=True).start()

    def stop(self) -> None:
        self._ended.set()

    def _keep(self) -> None:
        pause_s = often_s = self._context.settings.lease_s / _LOOKS_A_LEASE
        while not self._ended.wait(pause_s):
            try:
                self.do_turn()
            except SchemaDiffers as error:
                log.error("%s: this worker ends", error)  # noqa: TRY400  expected: no traceback
                os.kill(os.getppid(), signal.SIGTERM)
                return
            except Exception:
                log.exception("upkeep")
            pause_s = often_s if self._leads else 3 * often_s

    def do_turn(self) -> None:
        try:
            self._turn()
        except SchemaDiffers:
            raise
        except SQLAlchemyError as error:
            # while the database is away nobody can renew a lease
            self._renews = True
            if self._away_since is None:
                self._away_since = time.monotonic()
                log.warning("the database does not serve; no job is begun: %s", summarise(error))
        else:
            if self._away_since is not None:
                log.warning("the database serves again after %.0f s", time.monotonic() - self._away_since)
                self._away_since = None

    def _turn(self) -> None:
        context, lease_s = self._context, self._context.settings.lease_s
        if jumped_s := self._wall.jumped_s():
            log.warning("the clock has jumped by %+.0f s: every lease begins again", jumped_s)
            self._renews = True
        if self._renews or time.monotonic() - self._renewed_at > lease_s / 3:
            # before others are looked at: what this process works on is not lost, however late it is
            context.leases.renew(context.database, lease_s)
            self._renewed_at = time.monotonic()
        # the pulse is the parent's, which hands out the jobs
        self._presence.beat(worked_s_ago=pulse.find_silence_s())
        with context.database.reading() as session:
            require_own_schema(session)
            found = look(session, lease_s=lease_s)
            leads = self._leads or self._presence.leads(session)
        if leads and not self._leads:
            self._leads = True
            self._lead()
        late = found.late or Dependency.BROKER in self._away
        if self._renews or found.lost or found.unsent or late:
            self._sweep(lost=found.lost, late=late)
        if found.held_back or Dependency.BLOBS in self._away:
            self._check_store()
        if found.stale and (campaign_id := context.reviews.claim_next()) and context.database.post:
            context.database.post.send([queues.Message(queues.REVIEW, None, campaign_id)])

    def _sweep(self, *, lost: bool, late: bool) -> None:
        database = self._context.database
        waiting = None
        if database.post and late:
            waiting = database.post.count()
            self._note(Dependency.BROKER, away=waiting is None)
        with database.writing("sweeper") as session:
            if lost or self._renews:
                mend_times(session, lease_s=self._context.settings.lease_s, jumped=self._renews)
                take_back(session, Job.lease_until < utc_now())
            queues.unsend_lost(session, waiting or {})
            queues.touch(session)
        self._renews = False

    def _check_store(self) -> None:
        """Send again what waits for the file store, once it serves; until then nothing that needs it is."""
        away = not serves(self._context.blobs)
        self._note(Dependency.BLOBS, away=away)
        if not away:
            with self._context.database.writing("sweeper") as session:
                resume(session, Dependency.BLOBS)

    def _note(self, what: Dependency, *, away: bool) -> None:
        if away != (what in self._away):
            log.warning(
                "%s %s", what.label, "does not serve; what needs it waits" if away else "serves again"
            )
            kept = {each: since for each, since in self._away.items() if each != what}
            self._away = kept | ({what: utc_now().isoformat()} if away else {})
            self._presence.note(away=self._away)
