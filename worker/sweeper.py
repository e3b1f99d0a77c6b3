"""``python -m worker.sweeper``: finds what was lost, hints at it again, sweeps the floor."""

import logging
import sys
import time

from sqlalchemy.exc import SQLAlchemyError

from store import jobs
from store.blobs import Blobs, StorageUnavailable, blobs_from_url
from store.broker import Hints
from store.clocks import ClockWatch, mend_times
from store.database import Database
from store.parts import Presence
from store.settings import Settings

log = logging.getLogger(__name__)

_FLOOR_EVERY_S = 3600.0
_ABANDONED_AFTER_S = 24 * 3600.0


def sweep_jobs(database: Database, hints: Hints, *, lease_s: float, jumped: bool = False) -> None:
    """One round: leases, then hints for whatever waits."""
    with database.writing("sweeper") as session:
        mend_times(session, lease_s=lease_s, jumped=jumped)
        waiting = jobs.sweep(session)
    hints.send(waiting)


def sweep_floor(blobs: Blobs) -> None:
    """Remove what killed uploads left half written a day ago."""
    removed = blobs.sweep_temporary(_ABANDONED_AFTER_S)
    if removed:
        log.info("removed %d abandoned uploads", removed)


def main() -> int:
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    settings = Settings()
    database = Database(settings.effective_database_url, answer_within_s=settings.database_timeout_s)
    blobs = blobs_from_url(settings.effective_blobs_url, settings.data)
    hints = Hints(settings.effective_broker_url)
    clock = ClockWatch()
    presence = Presence(database, "sweeper")
    floor_due = 0.0
    while True:
        try:
            if jumped_s := clock.jumped_s():
                log.warning("the clock has jumped by %+.0f s: every lease begins anew", jumped_s)
            sweep_jobs(database, hints, lease_s=settings.lease_s, jumped=bool(jumped_s))
            presence.beat()
            if time.monotonic() >= floor_due:
                sweep_floor(blobs)
                floor_due = time.monotonic() + _FLOOR_EVERY_S
        except (SQLAlchemyError, StorageUnavailable, OSError) as error:
            log.warning("this round failed, the next comes: %s", error)
        time.sleep(settings.sweep_interval_s)


if __name__ == "__main__":
    sys.exit(main())
