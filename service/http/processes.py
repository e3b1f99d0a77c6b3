"""Processes of the service: several behind one port, their vital signs, and stopping in order."""

import asyncio
import atexit
import logging
import os
import re
import shutil
import signal
import socket
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from http import HTTPMethod
from pathlib import Path
from secrets import token_hex
from time import monotonic
from types import FrameType
from typing import TYPE_CHECKING, Any

import uvicorn
from prometheus_client import values
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from radiometry.findings import interface
from service.http import problems
from service.http.counts import name_address
from service.launch.folder import Exit, report
from service.launch.supervisor import Forked, GaveUp, Part, Patience, Signals, Supervisor
from service.system.health import Metrics
from store.jobs.processes import Presence
from store.log_fields import fields
from store.pulse import Pulse
from store.settings import Settings

if TYPE_CHECKING:
    from service.http.context import Context

_TO_END_S = 4.0  # what a process needs to end once its own grace is over, less than this one is given

Serve = Callable[[Path], None]


def share_metrics() -> None:
    """Have the processes that are forked from this one count requests together; call it before all else."""
    os.environ["PROMETHEUS_MULTIPROC_DIR"] = _make_folder()
    values.ValueClass = values.MultiProcessValue()  # type: ignore[no-untyped-call]


def _make_folder() -> str:
    """Make a folder that ends with this process; a forked one leaves without that."""
    folder = tempfile.mkdtemp(prefix="stilb-service-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def serve_forked(settings: Settings, serve: Serve) -> int:
    """Keep so many processes at work, each with a pulse, until a signal comes; the exit code."""
    pulse, pulses = Pulse(), Path(_make_folder())
    supervisor = Supervisor(data=settings.data, patience=Patience(hang_s=settings.hang_s), pulses=pulses)
    with Signals() as signals:
        try:
            for number in range(1, settings.workers + 1):
                name = f"service-{number}"
                part = Part(
                    name=name,
                    run=partial(Forked, partial(serve, pulses / f"{name}.pulse")),
                    stop_within_s=settings.stop_grace_s + _TO_END_S,
                    has_pulse=True,
                )
                supervisor.start(part)
            while not signals.stops:
                signals.wait(supervisor.look_after())
                pulse.beat()
        except GaveUp as failure:
            report(str(failure))
            return Exit.GAVE_UP
        finally:
            supervisor.stop(signals)
    return Exit.STOPPED


_LOOK_EVERY_S = 5.0
_SHARE_EVERY_S = 1.0
_THREADS_PATIENCE = 5  # all threads may be at slow uploads for longer than a loop may stand still


@dataclass
class Vitals:
    """Goes the way of a request every few seconds, through loop and thread, and beats if it gets through."""

    presence: Presence
    pulse: Pulse
    context: "Context"

    def __post_init__(self) -> None:
        self._free_at = time.monotonic()

    async def keep(self) -> None:
        """Beat until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._go_through_thread())
            tasks.create_task(self._share_counts())
            while True:
                if time.monotonic() - self._free_at < _THREADS_PATIENCE * self.context.settings.hang_s:
                    self.pulse.beat()
                await asyncio.sleep(_LOOK_EVERY_S)

    async def _share_counts(self) -> None:
        """Share what this process counts, whenever that has changed, and count with the others' counts."""
        told: dict[str, Any] = {}
        while True:
            await asyncio.sleep(_SHARE_EVERY_S)
            counts = {"requests": self.context.rates.tell(), "failures": self.context.attempts.tell()}
            if counts != told:
                told, heard = counts, await run_in_threadpool(self.presence.share, counts)
                self.context.rates.hear(each["requests"] for each in heard)
                self.context.attempts.hear(each["failures"] for each in heard)

    async def _go_through_thread(self) -> None:
        while True:
            await run_in_threadpool(self.presence.beat)
            self._free_at = time.monotonic()
            await asyncio.sleep(_LOOK_EVERY_S)


log = logging.getLogger("stilb.request")

COME_BACK_S = 2
_REQUEST_ID = "X-Request-ID"
_PLAIN = re.compile(r"[\w.:-]{1,64}", re.ASCII)
# what machines ask for every few seconds, and what a page loads
_REFUSED = frozenset({401, 403})
_UNLOGGED = ("/livez", "/readyz", "/metrics", "/static/")
_LINGER_S = 1.0
_METHODS = frozenset(HTTPMethod)


def stopping() -> problems.Problem:
    return problems.Problem(
        interface.SERVICE_STOPPING,
        "The service is being stopped or restarted. Try again.",
        headers={"Retry-After": str(COME_BACK_S), "Connection": "close"},
    )


class Traffic:
    """The requests that are open, and whether the service is stopping; in the event loop's thread alone."""

    def __init__(self) -> None:
        self.stopping = False
        self.closed = False  # nothing more is begun
        self.metrics = Metrics()
        self._open: set[_Exchange] = set()
        self._empty = asyncio.Event()
        self._empty.set()

    async def run_out(self, *, grace_s: float, notice_s: float) -> None:
        """Return when nothing is open, after the notice at least; what outlasts the grace is cut."""
        self.stopping = True
        with suppress(TimeoutError):
            async with asyncio.timeout(grace_s):
                await asyncio.sleep(notice_s)
                await self._empty.wait()
        self.closed = True
        await asyncio.gather(*(exchange.cut() for exchange in list(self._open)))

    async def carry(self, app: ASGIApp, scope: Scope, receive: Receive, send: Send) -> None:
        """Run one request, unless the service has closed."""
        if self.closed:
            await problems.answer(stopping())(scope, receive, send)
            return
        exchange = _Exchange(self, scope, receive, send)
        self._open.add(exchange)
        self._empty.clear()
        began = monotonic()
        with fields(request_id=exchange.request_id):
            try:
                await app(scope, receive, exchange.send)
            except asyncio.CancelledError:
                if not exchange.is_cut:
                    raise
            except Exception:
                exchange.status = exchange.status or 500  # what is answered for it, further out
                raise
            finally:
                # neither an address that no route has nor an unknown method is a label: whoever asks could
                # make as many as they like
                route = getattr(scope.get("route"), "path", "none")
                method = scope["method"] if scope["method"] in _METHODS else "other"
                took_s = monotonic() - began
                self.metrics.observe(method, route, exchange.status, took_s=took_s)
                told = {"method": method, "route": route, "status": exchange.status}
                is_refused = exchange.status in _REFUSED
                if is_refused:
                    told["address"] = name_address((scope.get("client") or [None])[0])
                if is_refused or not route.startswith(_UNLOGGED):
                    log.info("request", extra={"fields": told | {"duration_s": round(took_s, 4)}})
                self._open.discard(exchange)
                if not self._open:
                    self._empty.set()
        await exchange.ended.wait()


class _Exchange:
    """One request and its answer."""

    def __init__(self, traffic: Traffic, scope: Scope, receive: Receive, send: Send) -> None:
        self._traffic = traffic
        self._scope = scope
        self._receive = receive
        self._send = send
        self._task = asyncio.current_task()
        self._answering = False
        self.status = 0
        self.is_cut = False
        given = Headers(scope=scope).get(_REQUEST_ID, "")
        self.request_id = given if _PLAIN.fullmatch(given) else f"req_{token_hex(12)}"
        self.ended = asyncio.Event()
        self.ended.set()

    async def send(self, message: Message) -> None:
        if self.is_cut:
            return
        if message["type"] == "http.response.start":
            self._answering, self.status = True, message["status"]
            MutableHeaders(scope=message)[_REQUEST_ID] = self.request_id
            if self._traffic.stopping:
                # Whoever keeps this connection would find it closed under its next request.
                MutableHeaders(scope=message)["Connection"] = "close"
        await self._send(message)

    async def cut(self) -> None:
        """Answer in the place of the route; an answer on its way cannot be called back and breaks off."""
        self.is_cut = True
        self.ended.clear()
        try:
            if self._task is not None:
                # A thread that works for it is not stopped by this: what it still answers is dropped.
                self._task.cancel()
            if not self._answering:
                await problems.answer(stopping())(self._scope, self._receive, self._linger)
        finally:
            self.ended.set()

    async def _linger(self, message: Message) -> None:
        """Send; and before the end hear the sender out for a moment, or a reset overtakes the answer."""
        if message["type"] != "http.response.body":
            await self._send(message)
            return
        await self._send({**message, "more_body": True})
        with suppress(TimeoutError):
            async with asyncio.timeout(_LINGER_S):
                while (await self._receive()).get("more_body", False):
                    pass
        await self._send({"type": "http.response.body", "body": b"", "more_body": False})


class Server(uvicorn.Server):
    """Stops in order, listening to the end: waits for jobs end, requests end or are cut, the port closes."""

    def __init__(self, config: uvicorn.Config, context: "Context") -> None:
        super().__init__(config)
        self._context = context
        self._loop: asyncio.AbstractEventLoop | None = None
        self._asked_to_stop = asyncio.Event()

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:  # noqa: ARG002  uvicorn calls it
        # Uvicorn would keep the signal and die of it in the end; an end in order is none.
        self.force_exit = self.should_exit and sig == signal.SIGINT
        self.should_exit = True
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._asked_to_stop.set)

    async def main_loop(self) -> None:
        """Turn once a second, for the date of the answers; Uvicorn's own loop turns ten times."""
        self._loop = asyncio.get_running_loop()
        while not await self.on_tick(0):
            with suppress(TimeoutError):
                async with asyncio.timeout(1.0):
                    await self._asked_to_stop.wait()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        settings = self._context.settings
        self._context.watch.release()
        await self._context.traffic.run_out(grace_s=settings.stop_grace_s, notice_s=settings.stop_notice_s)
        await super().shutdown(sockets)
