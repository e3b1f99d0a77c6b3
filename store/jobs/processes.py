"""Processes of service and worker: heartbeats, chores beside their work, and how long their jobs took."""

import itertools
import logging
import os
import socket
import threading
import time
from bisect import bisect_left
from collections.abc import Callable, Mapping
from datetime import timedelta
from functools import partial
from typing import Any, Final, Literal, get_args

from sqlalchemy import ColumnElement, delete, insert, or_, select
from sqlalchemy.exc import IntegrityError, SQLAlchemyError
from sqlalchemy.orm import Session

from store.blobs import Blobs, StorageUnavailable
from store.blobs.partials import Partials
from store.database import Database, SchemaDiffers, summarise
from store.queries import update_where
from store.tables import JobKind, PartRow, utc_now
from store.tables.job import STALE_AFTER_S

BOUNDS_S: Final = (0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0, 300.0, 1800.0)


class Durations:
    """Jobs of one process by kind: how many took at most each bound, beyond the last, and their sum [s]."""

    def __init__(self) -> None:
        self.found = {kind: [0.0] * (len(BOUNDS_S) + 2) for kind in get_args(JobKind)}

    def observe(self, kind: str, seconds: float) -> None:
        self.found[kind][bisect_left(BOUNDS_S, seconds)] += 1
        self.found[kind][-1] += seconds


Kind = Literal["service", "worker"]

BEAT_EVERY_S = 10.0
_FORGET_AFTER = timedelta(minutes=10)
_SLOT_ATTEMPTS = 100


class Presence:
    """The heartbeat of this process; call `beat` from the loop that does the work, as often as it turns."""

    def __init__(self, database: Database, kind: Kind, **details: Any) -> None:  # noqa: ANN401  JSON
        self._database, self._kind = database, kind
        self._details = details
        self._id = ""
        self._started_at = utc_now()
        self._due = 0.0

    def note(self, **details: Any) -> None:  # noqa: ANN401  JSON
        """Add what others may want to know of this process; the next beat writes it."""
        self._details = self._details | details
        self._due = 0.0

    def beat(self, *, worked_s_ago: float = 0.0) -> None:
        """Write the heartbeat if one is due. A database that does not answer misses it, and stops nobody."""
        if time.monotonic() < self._due:
            return
        self._due = time.monotonic() + BEAT_EVERY_S
        for _ in range(_SLOT_ATTEMPTS):
            try:
                with self._database.writing(self._kind) as session:
                    self._write(session, worked_s_ago)
            except IntegrityError:
                # another that starts has just taken the same slot
                continue
            except SQLAlchemyError:
                pass
            return

    def share(self, counts: Mapping[str, Any]) -> list[Mapping[str, Any]]:
        """Write what this process counts for others of its kind, if there are any; return what they wrote."""
        live = PartRow.seen_at > utc_now() - timedelta(seconds=STALE_AFTER_S)
        others = select(PartRow.counts).where(PartRow.kind == self._kind, ~self._is_mine, live)
        try:
            with self._database.reading() as session:
                found = list(session.scalars(others))
            if found:
                with self._database.writing(self._kind) as session:
                    update_where(session, PartRow, self._is_mine, counts=counts)
        except SQLAlchemyError:
            return []
        return [each for each in found if each]

    def leave(self) -> None:
        """Remove the row at an orderly end; that of a killed process is forgotten after a while."""
        try:
            with self._database.writing(self._kind) as session:
                session.execute(delete(PartRow).where(self._is_mine))
        except SQLAlchemyError:
            return

    def leads(self, session: Session) -> bool:
        """Return True if no working process of this kind started earlier: it does what one is enough for."""
        parts = list_parts(session)
        working = (part for part in parts if (part.kind, part.state) == (self._kind, "working"))
        first = next(working, None)
        # another may have taken the slot, while this one seemed to be gone
        return first is not None and (first.id, first.started_at) == (self._id, self._started_at)

    @property
    def _is_mine(self) -> ColumnElement[bool]:
        return (PartRow.id == self._id) & (PartRow.started_at == self._started_at)

    def _write(self, session: Session, worked_s_ago: float) -> None:
        now = utc_now()
        worked_at = now - timedelta(seconds=worked_s_ago)
        values = {"seen_at": now, "worked_at": worked_at, "details": self._details}
        if not update_where(session, PartRow, self._is_mine, **values):
            taken = {part.id for part in list_parts(session) if part.state != "gone"}
            slots = (f"{self._kind}-{number}" for number in itertools.count(1))
            self._id = next(slot for slot in slots if slot not in taken)
            session.execute(delete(PartRow).where(PartRow.id == self._id))
            me = {"id": self._id, "kind": self._kind, "host": socket.gethostname(), "pid": os.getpid()}
            session.execute(insert(PartRow).values(me | {"started_at": self._started_at} | values))
        # Those that ended without a word; one that still runs after all takes a slot again.
        gone = or_(PartRow.seen_at < now - _FORGET_AFTER, PartRow.seen_at > now + _FORGET_AFTER)
        session.execute(delete(PartRow).where(gone))


def list_parts(session: Session) -> list[PartRow]:
    """Return every process that is remembered, the longest running first, those that are gone too."""
    return list(session.scalars(select(PartRow).order_by(PartRow.started_at, PartRow.id)))


log = logging.getLogger(__name__)

_AFTER_FAULT_S: Final = 10.0
_FLOOR_EVERY_S: Final = 3600.0
_ABANDONED_AFTER_S: Final = 24 * 3600.0


def repeat(name: str, chore: Callable[[], float]) -> None:
    """Do a chore until the process ends, each time after the pause [s] that the last one returned."""
    threading.Thread(target=_repeat, args=[name, chore], name=name, daemon=True).start()


def _repeat(name: str, chore: Callable[[], float]) -> None:
    trouble = ""
    while True:
        try:
            pause_s = chore()
            if trouble:
                log.warning("%s: works again", name)
            trouble = ""
        except SchemaDiffers:
            return
        except (SQLAlchemyError, StorageUnavailable, OSError) as error:
            pause_s = _AFTER_FAULT_S
            if not trouble:
                trouble = summarise(error)
                log.warning("%s: fails until further notice: %s", name, trouble)
        time.sleep(pause_s)


def sweep_floor(blobs: Blobs, partials: Partials) -> None:
    """Remove every hour what killed uploads left a day ago, and uploads in pieces that have expired."""
    repeat("floor", partial(_sweep_floor, blobs, partials))


def _sweep_floor(blobs: Blobs, partials: Partials) -> float:
    if removed := blobs.sweep_temporary(_ABANDONED_AFTER_S) + partials.sweep():
        log.info("removed %d abandoned uploads", removed)
    return _FLOOR_EVERY_S
