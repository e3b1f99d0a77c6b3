"""``python -m worker.sweeper``: takes back what dead workers held, sweeps the floor, proves stored files."""

import gc

gc.disable()  # until everything is imported: collections took a quarter of that time and freed nothing

import logging
import sys
import time

from sqlalchemy import select
from sqlalchemy.exc import SQLAlchemyError

from store import jobs
from store.blobs import Blobs, StorageUnavailable, blobs_from_url
from store.clocks import ClockWatch, mend_times
from store.database import Database, summarise
from store.files import Files
from store.logs import configure_logging
from store.partials import Partials
from store.parts import Presence
from store.pulse import Pulse
from store.schema import OTHER_SCHEMA_EXIT, SchemaDiffers, require_own_schema
from store.settings import Settings, read_settings
from store.tables import Job
from worker.scrub import Scrub
from worker.webhooks import Deliveries

gc.freeze()
gc.enable()

log = logging.getLogger(__name__)

_FLOOR_EVERY_S = 3600.0
_ABANDONED_AFTER_S = 24 * 3600.0


def sweep_jobs(database: Database, *, lease_s: float, renew: bool = False) -> None:
    """Queue the jobs again whose leases have run out; ``renew`` : first renew every lease."""
    with database.reading() as session:
        require_own_schema(session)
        if session.scalar(select(Job.id).where(Job.state.in_(("queued", "running"))).limit(1)) is None:
            return
    with database.writing("sweeper") as session:
        mend_times(session, lease_s=lease_s, jumped=renew)
        jobs.sweep(session)


def sweep_floor(blobs: Blobs, partials: Partials) -> None:
    """Remove what killed uploads left half written a day ago, and those in pieces that have expired."""
    removed = blobs.sweep_temporary(_ABANDONED_AFTER_S) + partials.sweep()
    if removed:
        log.info("removed %d abandoned uploads", removed)


def main() -> int:
    settings = read_settings()
    configure_logging(settings.log)
    database = Database(settings.effective_database_url, answer_within_s=settings.database_timeout_s)
    try:
        database.guard_schema()
        return _sweep(settings, database)
    except SchemaDiffers as error:
        log.error("%s: nothing is swept", error)  # noqa: TRY400  expected: no traceback
        return OTHER_SCHEMA_EXIT


def _sweep(settings: Settings, database: Database) -> int:
    blobs = blobs_from_url(settings.effective_blobs_url, settings.data)
    partials = Partials.of(settings)
    clock = ClockWatch()
    Scrub(database, Files(database, blobs), days=settings.scrub_days).start()
    Deliveries(database, settings.private_webhook_hosts).start()
    presence = Presence(database, "sweeper")
    pulse = Pulse(settings.pulse)
    floor_due = 0.0
    trouble, was_away = "", False
    while True:
        try:
            if jumped_s := clock.jumped_s():
                log.warning("the clock has jumped by %+.0f s: every lease begins again", jumped_s)
            # while the database was away nobody could renew a lease
            sweep_jobs(database, lease_s=settings.lease_s, renew=bool(jumped_s) or was_away)
            was_away = False
            presence.beat()
            if time.monotonic() >= floor_due:
                sweep_floor(blobs, partials)
                floor_due = time.monotonic() + _FLOOR_EVERY_S
            if trouble:
                trouble = ""
                log.warning("rounds succeed again")
        except SchemaDiffers:
            raise
        except (SQLAlchemyError, StorageUnavailable, OSError) as error:
            was_away = isinstance(error, SQLAlchemyError)
            if not trouble:
                trouble = summarise(error)
                log.warning("rounds fail until further notice: %s", trouble)
        pulse.beat()
        time.sleep(settings.sweep_interval_s)


if __name__ == "__main__":
    sys.exit(main())
