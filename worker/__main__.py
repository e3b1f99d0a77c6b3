"""``python -m worker``: threads that do jobs, and a Celery worker that wakes them when a message comes."""

import gc

gc.disable()  # until everything is imported: collections took a quarter of that time and freed nothing

import logging
import sys
from typing import Any

from store.blobs import blobs_from_url
from store.broker import RUN_TASK, make_celery
from store.chores import sweep_floor
from store.database import Database
from store.logs import configure_logging
from store.partials import Partials
from store.parts import Presence
from store.pulse import Pulse
from store.schema import OTHER_SCHEMA_EXIT, SchemaDiffers
from store.settings import Settings, read_settings
from store.tracing import configure_tracing
from worker.context import Context
from worker.decode.malloc import keep_memory, share_one_arena
from worker.decode.pool import DecoderPool, DecoderUnavailable
from worker.leases import Leases
from worker.needs import Needs
from worker.renewal import Renewal
from worker.scrub import Scrub
from worker.shutdown import Stop
from worker.threads import JobThreads
from worker.watchdog import Watchdog
from worker.webhooks import Deliveries

NO_DECODER_EXIT = 71

gc.freeze()
gc.enable()

log = logging.getLogger("stilb.worker")


def build_context(settings: Settings) -> Context:
    """Open the world that the settings name."""
    database = Database(settings.effective_database_url, answer_within_s=settings.database_timeout_s)
    blobs = blobs_from_url(settings.effective_blobs_url, settings.data)
    return Context(
        settings=settings,
        database=database,
        blobs=blobs,
        decoders=DecoderPool(
            settings.worker_threads,
            memory_bytes=settings.decoder_memory_bytes,
            cpu_seconds=settings.decoder_cpu_s,
            wall_seconds=settings.decoder_wall_s,
        ),
        leases=Leases(database, settings.lease_s),
        needs=Needs(blobs),
    )


def start_decoders(decoders: DecoderPool, *, require: bool) -> dict[str, Any]:
    """Start the decoders' zygote and tell how far its cells are shut in: the level, and part by part."""
    sandbox = decoders.start()
    held = ", ".join(name for name, holds in sandbox.parts.items() if holds) or "no part"
    log.info("decoder sandbox: %s (%s)", sandbox.level, held)
    if sandbox.lacks:
        lacks = f"this kernel gives the decoders no {', no '.join(sandbox.lacks)}"
        if require:
            raise DecoderUnavailable(f"STILB_DECODER_SANDBOX=require, and {lacks}.")
        log.warning("%s: a hostile file that takes a decoder over is held back by less", lacks)
    return {"level": sandbox.level, **sandbox.parts}


def build_threads(settings: Settings, context: Context, presence: Presence) -> JobThreads:
    """Make the threads that do the jobs, watched for whether they look for work."""
    watchdog = Watchdog(
        context.database, context.leases, presence, Pulse(settings.pulse), stall_s=settings.stall_s
    )
    return JobThreads(
        context,
        count=settings.worker_threads,
        look_s=settings.sweep_interval_s,
        looked=watchdog.worked,
        swept=watchdog.swept,
        noted=lambda away: presence.note(away={each: since.isoformat() for each, since in away.items()}),
    )


def start_chores(settings: Settings, context: Context, presence: Presence) -> None:
    """Sweep the floor, and do what one worker is enough for: renew statistics, prove files, send webhooks."""
    sweep_floor(context.blobs, Partials.of(settings))
    Renewal(context.database, leads=presence.leads).start()
    Scrub(context.database, context.files, days=settings.scrub_days, leads=presence.leads).start()
    Deliveries(context.database, settings, leads=presence.leads).start()


def listen(settings: Settings, threads: JobThreads) -> None:
    """Wake a thread at each message, as long as this process lives: the one task of a Celery worker."""
    from celery.signals import setup_logging

    app = make_celery(settings.effective_broker_url)
    # with a receiver Celery leaves the level of the root logger, and with it the lines of jobs, alone
    setup_logging.connect(_quieten_celery)

    @app.task(name=RUN_TASK)  # type: ignore[untyped-decorator]
    def wake(*_job_ids: str) -> None:
        threads.wake()

    # not `worker_main`: Celery's command line is 13 MB and 0.1 s more
    app.Worker(
        pool="solo",
        quiet=True,
        without_gossip=True,
        without_mingle=True,
        without_heartbeat=True,
    ).start()


def _quieten_celery(**_: object) -> None:
    """Log what Celery warns of, and neither its greeting nor a line for each message."""
    logging.getLogger("celery").setLevel(logging.WARNING)


def main() -> int:
    # maps and regions take the same large blocks again and again
    share_one_arena()
    keep_memory()
    settings = read_settings()
    configure_logging(settings.log)
    configure_tracing("worker")
    context = build_context(settings)
    try:
        context.database.guard_schema()
    except SchemaDiffers as error:
        log.error("%s: no job is done", error)  # noqa: TRY400  expected: no traceback
        return OTHER_SCHEMA_EXIT
    try:
        sandbox = start_decoders(context.decoders, require=settings.decoder_sandbox == "require")
    except DecoderUnavailable as error:
        log.error("%s No job is done", error)  # noqa: TRY400  expected: no traceback
        return NO_DECODER_EXIT
    presence = Presence(
        context.database,
        "worker",
        threads=settings.worker_threads,
        decoder_sandbox=sandbox,
        job_seconds=context.durations.found,
    )
    threads = build_threads(settings, context, presence)
    stop = Stop(threads, context.leases, presence, grace_s=settings.stop_grace_s)
    stop.heed_signals()
    threads.start()
    start_chores(settings, context, presence)
    try:
        listen(settings, threads)
    finally:
        stop.run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
