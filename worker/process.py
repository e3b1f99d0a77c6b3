"""The processes of a worker: Celery's parent, which tends the decoders, and the pool, which does the jobs."""

import gc
import logging
import os
import signal
import sys
from collections.abc import Mapping
from typing import Any

from billiard.util import get_pdeathsig
from celery import Task, signals
from celery.exceptions import Retry
from sqlalchemy.exc import SQLAlchemyError

from store import jobs, logs, pulse
from store.blobs.partials import Partials
from store.database import OTHER_SCHEMA_EXIT, Database, SchemaDiffers, require_own_schema, summarise
from store.jobs import processes, queues
from worker import app, background, runner
from worker.context import build_context, open_database
from worker.decode.pieces import keep_memory, share_one_arena
from worker.decode.pool import DecoderPool, DecoderUnavailable
from worker.upkeep import Upkeep, look

log = logging.getLogger("stilb.worker")

NO_DECODER_EXIT = 71
_FAREWELL_S = 3.0

decoders = DecoderPool()
_pulse = pulse.Pulse()
_mine: dict[str, Any] = {}  # of a pool process: context, upkeep, presence; of the parent: database, sandbox


class JobFailed(Exception):  # noqa: N818  it is what happened
    """The job has failed, as its row says; raised so that Celery's monitors show it."""


def do_job(task: Task, _subject_id: str) -> Mapping[str, Any]:
    ended = runner.run(_mine["context"], task.request.id)
    match ended["state"]:
        case "failed":
            raise JobFailed(ended["code"])
        case "queued":
            raise Retry(f"waits for {ended['waits_for']}", when=ended["due_at"])
    return ended


for name in {lane.task for lane in queues.LANES.values()}:
    app.app.task(name=name, bind=True, throws=(JobFailed,))(do_job)


@app.app.task(name=queues.REVIEW.task)  # type: ignore[untyped-decorator]
def review(campaign_id: str) -> None:
    _mine["context"].reviews.renew(campaign_id)


@app.app.task(name=queues.CANCEL.task)  # type: ignore[untyped-decorator]
def cancel(job_id: str) -> None:
    with _mine["context"].database.writing("worker") as session:
        jobs.cancel(session, job_id)


def tend() -> None:
    _pulse.beat()  # the parent's loop turns
    decoders.look_after()


def start_decoders(pool: DecoderPool, *, require: bool) -> dict[str, Any]:
    """Start the decoders' zygote and tell how far its cells are shut in: the level, and part by part."""
    sandbox = pool.start()
    held = ", ".join(name for name, holds in sandbox.parts.items() if holds) or "no part"
    log.info("decoder sandbox: %s (%s)", sandbox.level, held)
    if sandbox.lacks:
        lacks = f"this kernel gives the decoders no {', no '.join(sandbox.lacks)}"
        if require:
            raise DecoderUnavailable(f"STILB_DECODER_SANDBOX=require, and {lacks}.")
        log.warning("%s: a hostile file that takes a decoder over is held back by less", lacks)
    return {"level": sandbox.level, **sandbox.parts}


@signals.setup_logging.connect  # type: ignore[untyped-decorator]
def log_our_way(**_: object) -> None:
    logs.configure_logging(app.settings.log)
    logging.getLogger("celery").setLevel(logging.WARNING)


@signals.worker_init.connect  # type: ignore[untyped-decorator]
def prepare(**_: object) -> None:
    """Load and check in the parent what its forks share."""
    log_our_way()  # which Celery asks for later
    # forks share what it has compiled by then, and none of its connections
    _mine["database"] = database = open_database(app.settings)
    try:
        database.guard_schema()
        with database.reading() as session:  # prepares the tables once for all forks
            look(session, lease_s=app.settings.lease_s)
            processes.list_parts(session)
        _mine["sandbox"] = start_decoders(decoders, require=app.settings.decoder_sandbox == "require")
    except SchemaDiffers as error:
        log.error("%s: no job is done", error)  # noqa: TRY400  expected: no traceback
        sys.exit(OTHER_SCHEMA_EXIT)
    except DecoderUnavailable as error:
        log.error("%s No job is done", error)  # noqa: TRY400  expected: no traceback
        sys.exit(NO_DECODER_EXIT)
    finally:
        database.dispose()
    get_pdeathsig()  # loads what each fork would else load for itself
    gc.collect()
    gc.freeze()


@signals.worker_process_init.connect  # type: ignore[untyped-decorator]
def begin(**_: object) -> None:
    """Open in a fork what none may share: its connections and its threads."""
    # maps and regions take the same large blocks again and again
    share_one_arena()
    keep_memory()
    decoders.share()
    context = build_context(app.settings, decoders, _mine["database"])
    presence = processes.Presence(
        context.database, "worker", decoder_sandbox=_mine["sandbox"], job_seconds=context.durations.found
    )

    def lead() -> None:
        processes.sweep_floor(context.blobs, Partials.of(app.settings))
        renewal = background.Renewal(context.database, leads=presence.leads)
        scrub = background.Scrub(context.database, context.files, leads=presence.leads)
        processes.repeat("renewal", renewal.do_round)
        processes.repeat("scrub", scrub.do_round)

    upkeep = Upkeep(context, presence, lead=lead)
    _mine.update(context=context, upkeep=upkeep, presence=presence)
    upkeep.start()


@signals.worker_process_shutdown.connect  # type: ignore[untyped-decorator]
def end(**_: object) -> None:
    _mine["upkeep"].stop()
    _mine["presence"].leave()


@signals.celeryd_after_setup.connect  # type: ignore[untyped-decorator]
def watch_for_stop(instance: Any, **_: object) -> None:  # noqa: ANN401  Celery's
    """End a stop within the grace: whoever still works then is killed, and its jobs are given back."""
    pids: set[int] = set()
    # each line of the log is one of JSON, or Celery greets
    instance.quiet = app.settings.log == "json"

    def kill(*_: object) -> None:
        # which has words for each that it loses
        logging.getLogger("celery").setLevel(logging.CRITICAL)
        for pid in pids:
            os.kill(pid, signal.SIGKILL)

    @signals.worker_shutting_down.connect(weak=False)  # type: ignore[untyped-decorator]
    def count_down(**_: object) -> None:
        pids.update(instance.pool.info["processes"])
        signal.signal(signal.SIGALRM, kill)
        signal.setitimer(signal.ITIMER_REAL, max(app.settings.stop_grace_s, 0.001))

    @signals.worker_shutdown.connect(weak=False)  # type: ignore[untyped-decorator]
    def give_back(**_: object) -> None:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        post = queues.Post(app.settings.effective_broker_url)
        database = Database(app.settings.effective_database_url, answer_within_s=_FAREWELL_S, post=post)
        try:
            with database.writing("worker") as session:
                require_own_schema(session)
                jobs.give_back(session, pids)
        except SchemaDiffers:
            instance.exitcode = OTHER_SCHEMA_EXIT
        except SQLAlchemyError as error:
            log.warning("jobs are left to their leases: %s", summarise(error))
        decoders.close()


@signals.task_revoked.connect  # type: ignore[untyped-decorator]
def pass_on(request: Any, **_: object) -> None:  # noqa: ANN401  Celery's
    """End a revoked job's row; by a task, since the parent waits for no database."""
    if request.task in {lane.task for lane in queues.LANES.values()}:
        queues.Post(app.settings.effective_broker_url).send([queues.Message(queues.CANCEL, None, request.id)])
