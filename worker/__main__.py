"""``python -m worker``: a Celery worker with threads, which runs the jobs that hints name."""

import logging
import sys

from celery import Celery, bootsteps
from kombu.asynchronous import Hub

from store.blobs import blobs_from_url
from store.broker import RUN_TASK, make_celery
from store.database import Database
from store.parts import Presence
from store.settings import Settings
from worker.context import Context
from worker.decode.pool import DecoderPool
from worker.leases import Leases
from worker.runner import run
from worker.watchdog import TURN_EVERY_S, Watchdog


def build_context(settings: Settings) -> Context:
    """Open the world that the settings name."""
    database = Database(settings.effective_database_url, answer_within_s=settings.database_timeout_s)
    return Context(
        settings=settings,
        database=database,
        blobs=blobs_from_url(settings.effective_blobs_url, settings.data),
        decoders=DecoderPool(
            settings.worker_threads,
            memory_bytes=settings.decoder_memory_bytes,
            cpu_seconds=settings.decoder_cpu_s,
            wall_seconds=settings.decoder_wall_s,
        ),
        leases=Leases(database, settings.lease_s),
    )


def build_worker(settings: Settings, context: Context, presence: Presence) -> Celery:
    """The Celery application with its one task."""
    app = make_celery(settings.effective_broker_url)
    watchdog = Watchdog(context.database, context.leases, presence, settings.stall_s)
    app.steps["consumer"].add(_watched_loop(watchdog))

    @app.task(name=RUN_TASK)  # type: ignore[untyped-decorator]
    def run_job(job_id: str) -> None:
        watchdog.worked()
        run(context, job_id)

    return app


def _watched_loop(watchdog: Watchdog) -> type[bootsteps.StartStopStep]:
    """Celery's loop itself tells the watchdog that it turns."""

    class Turns(bootsteps.StartStopStep):  # type: ignore[misc]
        def register_with_event_loop(self, _consumer: object, hub: Hub) -> None:
            hub.call_repeatedly(TURN_EVERY_S, watchdog.turned)  # type: ignore[no-untyped-call]

    return Turns


def main() -> int:
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    settings = Settings()
    context = build_context(settings)
    presence = Presence(context.database, "worker", threads=settings.worker_threads)
    app = build_worker(settings, context, presence)
    try:
        app.worker_main(
            [
                "worker",
                "--pool=threads",
                f"--concurrency={settings.worker_threads}",
                "--without-gossip",
                "--without-mingle",
                "--loglevel=WARNING",
            ]
        )
    finally:
        presence.leave()
    return 0


if __name__ == "__main__":
    sys.exit(main())
