"""The thread beside the jobs of a pool process: its leases, its heartbeat, and what was lost on the way."""

import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

from sqlalchemy.exc import SQLAlchemyError

from store.columns import utc_now
from store.database import summarise
from store.jobs import Dependency, resume, take_back
from store.parts import Presence
from store.pulse import read_beat
from store.queues import REVIEW, Message, touch, unsend_lost
from store.schema import SchemaDiffers, require_own_schema
from store.tables import Job
from store.upkeep import ClockWatch, look, mend_times
from worker.context import Context
from worker.runner import serves

log = logging.getLogger(__name__)


class Upkeep:
    """A look every ``STILB_SWEEP_INTERVAL_S`` for what no message brings about; most find nothing."""

    def __init__(self, context: Context, presence: Presence, *, lead: Callable[[], None]) -> None:
        """``lead`` begins, once, what one process of all workers is enough for."""
        self._context = context
        self._presence = presence
        self._lead = lead
        self._leads = False
        self._wall = ClockWatch()
        self._renewed_at = 0.0
        self._renews = False
        self._store_away = False
        self._away_since: float | None = None
        self._ended = threading.Event()

    def start(self) -> None:
        threading.Thread(target=self._keep, name="upkeep", daemon=True).start()

    def stop(self) -> None:
        self._ended.set()

    def _keep(self) -> None:
        while not self._ended.wait(self._context.settings.sweep_interval_s):
            try:
                self.do_turn()
            except SchemaDiffers as error:
                log.error("%s: this worker ends", error)  # noqa: TRY400  expected: no traceback
                os.kill(os.getppid(), signal.SIGTERM)
                return
            except Exception:
                log.exception("upkeep")

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
        self._presence.beat(worked_s_ago=self._find_silence_s())
        with context.database.reading() as session:
            require_own_schema(session)
            found = look(session, lease_s=lease_s)
            leads = self._leads or self._presence.leads(session)
        if leads and not self._leads:
            self._leads = True
            self._lead()
        if self._renews or found.lost or found.unsent or found.late:
            self._sweep(lost=found.lost, late=found.late)
        if found.held_back or self._store_away:
            self._check_store()
        if found.stale and (campaign_id := context.reviews.claim_next()) and context.database.post:
            context.database.post.send([Message(REVIEW, None, campaign_id)])

    def _sweep(self, *, lost: bool, late: bool) -> None:
        database = self._context.database
        waiting = database.post.count() if database.post and late else None
        with database.writing("sweeper") as session:
            if lost or self._renews:
                mend_times(session, lease_s=self._context.settings.lease_s, jumped=self._renews)
                take_back(session, Job.lease_until < utc_now())
            unsend_lost(session, waiting or {})
            touch(session)
        self._renews = False

    def _check_store(self) -> None:
        """Send again what waits for the file store, once it serves; until then nothing that needs it is."""
        away = not serves(self._context.blobs)
        if away != self._store_away:
            self._store_away = away
            label = Dependency.BLOBS.label
            log.warning("%s %s", label, "does not serve; what needs it waits" if away else "serves again")
            self._presence.note(away={Dependency.BLOBS: utc_now().isoformat()} if away else {})
        if not away:
            with self._context.database.writing("sweeper") as session:
                resume(session, Dependency.BLOBS)

    def _find_silence_s(self) -> float:
        """Return for how long the parent has not turned, which hands out the jobs; 0 where nothing tells."""
        beat_ns = read_beat(Path(self._context.settings.pulse)) if self._context.settings.pulse else None
        return (time.monotonic_ns() - beat_ns) / 1e9 if beat_ns else 0.0
