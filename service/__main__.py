"""``python -m service``: serves the API on the database, broker and blobs that the settings name."""

import gc

_USUAL = gc.get_threshold()
# Seldom until everything is imported: often costs a fifth of that time, never leaves 10 MB of holes.
gc.set_threshold(20_000, 20, 20)

import asyncio
import logging
import os
import sys
from contextlib import suppress
from socket import socket

import uvicorn
from fastapi import FastAPI
from sqlalchemy import func, select

from service.documents.issuing import Backlog
from service.http import auth, signatures
from service.http.app import build_app
from service.http.connections import Connections, guarding, raise_file_limit
from service.http.context import Context
from service.http.processes import Server, Traffic, Vitals, serve_forked, share_metrics
from service.jobs.watch import JobWatch
from service.launch import folder, key
from service.system.health import Health
from store import logs, queries
from store.blobs import blobs_from_url, partials
from store.database import OTHER_SCHEMA_EXIT, Database, SchemaDiffers
from store.jobs.processes import Presence, repeat, sweep_floor
from store.jobs.queues import Post
from store.pulse import Pulse
from store.settings import Settings, read_settings

_TURN = 0x7374696C62


def found(database: Database, secret: str) -> None:
    """Make the operator, the first key and the counts unless they exist, one service after the other."""
    with database.writing("service") as session:
        if not database.is_sqlite:
            session.execute(select(func.pg_advisory_xact_lock(_TURN)))
        if secret:
            queries.organisations.ensure_operator(session, secret, list(auth.SCOPES))
        queries.usage.recount_all(session)


# what is imported by now stays
gc.freeze()
gc.set_threshold(*_USUAL)

log = logging.getLogger("stilb.service")

_FAREWELL_S = 2.0


def build_context(settings: Settings) -> Context:
    post = Post(settings.effective_broker_url)
    database = Database(
        settings.effective_database_url, answer_within_s=settings.database_timeout_s, post=post
    )
    blobs = blobs_from_url(settings.effective_blobs_url, settings.data)
    return Context(
        settings=settings,
        database=database,
        blobs=blobs,
        watch=JobWatch(database),
        sessions=signatures.sessions_of(settings),
        traffic=Traffic(),
        health=Health(database, blobs),
    )


def main() -> int:
    settings = read_settings()
    logs.configure_logging(settings.log)
    secret = settings.key.get_secret_value()
    try:
        folder.close_to_others(settings.data.absolute(), folder.report)
        if secret:
            key.refuse_weak_key(secret, "STILB_KEY")
        signatures.read_seed(settings)
    except folder.Refusal as refusal:
        folder.report(str(refusal))
        return refusal.code
    if settings.workers > 1:
        share_metrics()
    context = build_context(settings)
    try:
        context.database.guard_schema()
    except SchemaDiffers as error:
        log.error("%s: nothing is served", error)  # noqa: TRY400  expected: no traceback
        return OTHER_SCHEMA_EXIT
    found(context.database, secret)
    app = build_app(context)
    # What is loaded by now stays: collecting garbage need not walk through it in the middle of answers.
    gc.collect()
    gc.freeze()
    files = raise_file_limit()
    if settings.workers == 1:
        _serve(app, settings, files, Pulse())
    # no process may use the connections of another
    context.database.dispose()
    listening = uvicorn.Config(app, host=settings.host, port=settings.port, log_config=None).bind_socket()
    return serve_forked(settings, lambda path: _serve(app, settings, files, Pulse(str(path)), listening))


def _serve(
    app: FastAPI, settings: Settings, files: int, pulse: Pulse, listening: socket | None = None
) -> None:
    context: Context = app.state.context
    connections = Connections(files=files, per_peer=settings.connections_per_peer)
    config = uvicorn.Config(
        app,
        http=guarding(connections),
        host=settings.host,
        port=settings.port,
        log_config=None,
        access_log=False,
        # The server below has waited by then: this is for what answers are still on the wire.
        timeout_graceful_shutdown=1,
        server_header=False,
    )
    server = Server(config, context)
    sweep_floor(context.blobs, partials.Partials.of(settings))
    repeat("certificates", Backlog(context).issue_next)
    presence = Presence(context.database, "service")
    vitals = Vitals(presence, pulse, context)
    with asyncio.Runner(loop_factory=config.get_loop_factory()) as runner:
        runner.run(_keep_serving(server, vitals, presence, listening))


async def _keep_serving(server: Server, vitals: Vitals, presence: Presence, listening: socket | None) -> None:
    beating = asyncio.create_task(vitals.keep())
    await server.serve(None if listening is None else [listening])
    beating.cancel()
    with suppress(TimeoutError):
        async with asyncio.timeout(_FAREWELL_S):
            await asyncio.to_thread(presence.leave)
    logging.shutdown()
    # A thread that waits for a peer that is gone would hold the process long after the grace. What it was to
    # answer is cut by now, and all that was answered is durable.
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main())
