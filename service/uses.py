"""When a key and a session were last used: known to some minutes, so that reading need not write."""

import logging
import time
from datetime import datetime, timedelta
from threading import Lock
from typing import Final

from sqlalchemy.exc import SQLAlchemyError

from store.database import Database
from store.queries.organisations import note_use
from store.tables import ApiKey, WebSession
from store.tables.base import utc_now

STEP: Final = timedelta(minutes=10)
_MOST_KEPT: Final = 10_000


class Uses:
    """Writes a use down once in STEP, whichever process sees it; one that cannot be written is left out."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._lock = Lock()
        self._tried_at: dict[str, float] = {}

    def note(self, row: ApiKey | WebSession) -> None:
        """Write down that a key or a session is used just now, unless that is known well enough."""
        now = utc_now()
        if not _is_old(row.last_used_at, now) or not self._may_try(row.id):
            return
        try:
            with self._database.writing("service") as session:
                note_use(session, row, now, unless_after=now - STEP)
        except SQLAlchemyError as error:
            logging.getLogger(__name__).warning("when %s was used cannot be written: %s", row.id, error)

    def _may_try(self, row_id: str) -> bool:
        # a database that takes no writes must not make every request wait for it
        moment = time.monotonic()
        with self._lock:
            if moment < self._tried_at.get(row_id, float("-inf")) + STEP.total_seconds():
                return False
            if len(self._tried_at) >= _MOST_KEPT:
                self._tried_at.clear()
            self._tried_at[row_id] = moment
        return True


def _is_old(last_used_at: datetime | None, now: datetime) -> bool:
    return last_used_at is None or last_used_at < now - STEP
