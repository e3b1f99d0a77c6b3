"""Several processes of one service behind one port: `STILB_WORKERS`.

The first process loads everything, binds the port and serves nobody. The others are forked from it: they
share what is loaded, and one that dies or hangs is replaced in milliseconds. All of them accept from the same
queue of connections, so that whoever is free takes the next. What they must know of each other goes through
the database, as between containers.
"""

import atexit
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from socket import socket

from prometheus_client import values

from service.launch.lifeline import die_with_parent
from service.launch.refusal import Exit, report
from service.launch.signals import Signals
from service.launch.supervisor import GaveUp, Part, Patience, Supervisor
from store.pulse import Pulse
from store.settings import Settings

_TO_END_S = 4.0
"""What a process needs to end once its own grace is over, less than this one is given."""

Serve = Callable[[Settings, socket], None]


class Forked:
    """A child that begins with all that this process has loaded, with the face of a `Popen`."""

    def __init__(self, run: Callable[[], None]) -> None:
        tie = die_with_parent()
        self.returncode: int | None = None
        self.pid = os.fork()
        if self.pid == 0:
            try:
                tie()
                # a group of its own, as `Supervisor` kills groups
                os.setpgid(0, 0)
                signal.set_wakeup_fd(-1)
                for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGCHLD):
                    signal.signal(number, signal.SIG_DFL)
                run()
            finally:
                os._exit(1)
        with suppress(OSError):
            os.setpgid(self.pid, self.pid)

    def poll(self) -> int | None:
        """Return the exit code, or None while it runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float = 60.0) -> int:
        """Return the exit code once it has ended."""
        deadline = time.monotonic() + timeout
        while (code := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout)
            time.sleep(0.01)
        return code

    def terminate(self) -> None:
        """Ask it to end in order."""
        if self.poll() is None:
            os.kill(self.pid, signal.SIGTERM)


def share_metrics() -> None:
    """Have the processes that are forked from this one count requests together; call it before all else."""
    os.environ["PROMETHEUS_MULTIPROC_DIR"] = _make_folder()
    values.ValueClass = values.MultiProcessValue()  # type: ignore[no-untyped-call]


def _make_folder() -> str:
    """Make a folder that ends with this process; a forked one leaves without that."""
    folder = tempfile.mkdtemp(prefix="stilb-service-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def serve_forked(settings: Settings, listening: socket, serve: Serve) -> int:
    """Keep so many processes at work until a signal comes; the exit code."""
    pulse, pulses = Pulse(settings.pulse), Path(_make_folder())
    supervisor = Supervisor(
        environment={},
        key="",
        data=settings.data,
        lock=-1,
        patience=Patience(hang_s=settings.hang_s),
        report=report,
        pulses=pulses,
    )
    with Signals() as signals:
        try:
            for number in range(1, settings.workers + 1):
                name = f"service-{number}"
                own = settings.model_copy(update={"pulse": str(pulses / f"{name}.pulse")})
                part = Part(
                    name=name,
                    run=partial(Forked, partial(serve, own, listening)),
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
