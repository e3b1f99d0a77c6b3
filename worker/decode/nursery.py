"""Where cells come from, as their parent sees it: a zygote that is started with exec, and orders to it."""

import contextlib
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, Final

from worker.decode.sandbox import Sandbox
from worker.decode.settings import DecoderLimits

_ROOT: Final = Path(__file__).resolve().parents[2]
_START_SECONDS: Final = 60.0
_BIRTH_SECONDS: Final = 20.0
_END_SECONDS: Final = 5.0
_LONGEST_WORD: Final = 4096
# The kernel cuts this to its own limit for a socket: fewer changes of process on the way.
_ANSWER_BYTES: Final = 4 << 20


class DecoderUnavailable(Exception):  # noqa: N818  it says what happened
    """No decoding process can be had: an installation or a machine at fault, not a file."""


class Cell:
    """The parent's ends of one cell: requests go into `talk`, and answers come out of it.

    A socket, which takes an answer of some MiB in half of the time that a pipe takes for it.
    """

    def __init__(self) -> None:
        self.talk, self._its_talk = socket.socketpair()
        self._line, self._its_line = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.pid: int | None = None
        # a matter of speed only
        with contextlib.suppress(OSError):
            self._its_talk.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _ANSWER_BYTES)

    def order_from(self, control: socket.socket) -> None:
        """Ask the zygote for the process; only it has the other ends afterwards."""
        with self._its_talk, self._its_line:
            socket.send_fds(control, [b"cell"], [self._its_talk.fileno(), self._its_line.fileno()])

    def await_birth(self) -> bool:
        """Return True if there is, or was, such a process."""
        if self.pid is None:
            self.pid = self._hear(_BIRTH_SECONDS).get("pid")
        return self.pid is not None

    def is_over(self) -> bool:
        """Return True if the process is known to have ended, or never was."""
        return self.pid is not None and bool(_poll(self._line, 0))

    def give(self, descriptor: int) -> None:
        """Hand over the file, which only makes it this file's cell."""
        socket.send_fds(self.talk, [b"F"], [descriptor])

    def hear_end(self) -> int | None:
        """How the process ended: its exit code, below zero for a signal. None: its zygote is gone, too."""
        found = self._hear(_END_SECONDS)
        if "pid" in found:
            self.pid = found["pid"]
            found = self._hear(_END_SECONDS)
        return found.get("ended")

    def kill(self) -> None:
        """End the process now, and return when that has happened."""
        with contextlib.suppress(OSError):
            self._line.shutdown(socket.SHUT_WR)
        self.hear_end()
        self.close()

    def close(self) -> None:
        """Hang up: the process ends as soon as its zygote or it itself notices that."""
        self.talk.close()
        self._line.close()

    def _hear(self, seconds: float) -> dict[str, Any]:
        if not _poll(self._line, seconds):
            return {}
        try:
            word = self._line.recv(_LONGEST_WORD)
        except OSError:
            return {}
        return dict(json.loads(word)) if word else {}


def _poll(line: socket.socket, seconds: float) -> bool:
    poll = select.poll()
    poll.register(line, select.POLLIN)
    return bool(poll.poll(seconds * 1000))


class Nursery:
    """Thread-safe. Starts the zygote when it is first needed, and again whenever it has died.

    One cell is ordered ahead: it is forked, shut in and warmed up while the one before it computes.
    """

    def __init__(self, bounds: DecoderLimits) -> None:
        self._bounds = bounds
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._spare: Cell | None = None
        self._sandbox: Sandbox | None = None

    @property
    def pid(self) -> int | None:
        """Return the zygote's process id."""
        return self._process.pid if self._process else None

    def start(self) -> Sandbox:
        """Start the zygote unless it runs; what holds in its cells."""
        with self._lock:
            self._ensure_started()
            assert self._sandbox is not None  # noqa: S101  it comes with the zygote
            return self._sandbox

    def take(self) -> Cell:
        """A cell that has seen no file."""
        with self._lock:
            cell, self._spare = self._spare, None
            if cell is not None and (not cell.await_birth() or cell.is_over()):
                cell.close()
                cell = None
            cell = cell or self._order()
            if not cell.await_birth():
                cell.close()
                self._stop()
                raise DecoderUnavailable("The decoding processes' zygote does not answer.")
            return cell

    def prepare(self) -> None:
        """Order the next cell ahead, unless one waits already."""
        with self._lock, contextlib.suppress(DecoderUnavailable):
            self._spare = self._spare or self._order()

    def close(self) -> None:
        """End the zygote, and with it every cell."""
        with self._lock:
            self._stop()

    def abandon(self) -> None:
        """Forget a zygote that belongs to the parent of this process: after a fork it is not ours to end."""
        self._process = None

    def _order(self) -> Cell:
        for _ in range(2):
            control = self._ensure_started()
            cell = Cell()
            try:
                cell.order_from(control)
            except OSError:
                cell.close()
                self._stop()
            else:
                return cell
        raise DecoderUnavailable("The decoding processes' zygote takes no orders.")

    def _ensure_started(self) -> socket.socket:
        if self._control is not None and self._process is not None and self._process.poll() is None:
            return self._control
        self._stop()
        ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            self._process = subprocess.Popen(  # noqa: S603  our own interpreter, our own module
                [*_command(), *_arguments(self._bounds)],
                stdin=its.fileno(),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=_environment(),
                start_new_session=True,  # Ctrl-C in a terminal is for the parent alone
            )
        self._control = ours
        try:
            self._sandbox = self._await_ready(ours)
        except DecoderUnavailable:
            self._stop()
            raise
        return ours

    def _await_ready(self, control: socket.socket) -> Sandbox:
        control.settimeout(_START_SECONDS)
        try:
            ready = json.loads(control.recv(_LONGEST_WORD) or b"{}")
            if ready.get("ready") is True and ready.get("threads") == 1:
                return Sandbox(**ready["sandbox"])
        except (OSError, ValueError, TypeError) as error:
            raise DecoderUnavailable(f"The decoding processes do not start: {error!r}.") from error
        raise DecoderUnavailable(f"The decoding processes do not start: {self._autopsy(ready)}.")

    def _autopsy(self, ready: dict[str, Any]) -> str:
        if ready:
            return "they do not keep to the protocol"
        assert self._process is not None  # noqa: S101  it has just been started
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._process.wait(timeout=1.0)
            return f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
        return "they hung up"

    def _stop(self) -> None:
        spare, self._spare = self._spare, None
        process, self._process = self._process, None
        control, self._control = self._control, None
        self._sandbox = None
        if spare is not None:
            spare.close()
        if process is not None:
            process.kill()
            process.wait()
        if control is not None:
            control.close()


def _command() -> list[str]:
    return [sys.executable, "-s", "-P", "-m", "worker.decode"]


def _arguments(bounds: DecoderLimits) -> list[str]:
    return [
        *("--parent", str(os.getpid())),
        *("--memory-bytes", str(bounds.memory_bytes)),
        *("--cpu-seconds", str(bounds.cpu_seconds)),
    ]


def _environment() -> dict[str, str]:
    """Nothing that the service knows: no settings, no credentials. One thread per library."""
    kept = {name: os.environ[name] for name in ("PATH", "LANG") if name in os.environ}
    return {
        **kept,
        "PYTHONPATH": str(_ROOT),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
