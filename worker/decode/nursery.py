"""Where cells come from, as their parent sees it: a zygote that is started with exec, and orders to it."""

import contextlib
import json
import mmap
import os
import select
import signal
import socket
import subprocess
import threading
import time
from typing import Any, Final

from store.sandbox import Sandbox, build_command, build_environment
from worker.decode.settings import DecoderLimits

_START_SECONDS: Final = 60.0
_BIRTH_SECONDS: Final = 20.0
_LOOK_SECONDS: Final = 0.5
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
        self._is_lost = False
        # a matter of speed only
        with contextlib.suppress(OSError):
            self._its_talk.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _ANSWER_BYTES)

    def order_from(self, control: socket.socket) -> None:
        """Ask the zygote for the process; only it has the other ends afterwards."""
        with self._its_talk, self._its_line:
            socket.send_fds(control, [b"cell"], [self._its_talk.fileno(), self._its_line.fileno()])

    def await_birth(self, seconds: float) -> bool:
        """Return True once the process is there, or its order is lost, which `is_over` tells."""
        if self.pid is None:
            self.pid = self._hear(seconds).get("pid")
        return self.pid is not None or self._is_lost

    def is_over(self) -> bool:
        """Return True if the process has ended, or its zygote before it began."""
        return self._is_lost or (self.pid is not None and _poll(self._line, 0))

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
            word = b""
        self._is_lost = not word
        return dict(json.loads(word)) if word else {}


def _poll(line: socket.socket, seconds: float) -> bool:
    poll = select.poll()
    poll.register(line, select.POLLIN)
    return bool(poll.poll(seconds * 1000))


class Nursery:
    """Thread-safe. Starts the zygote when it is first needed, and again whenever it has died.

    A fork shares the zygote of the process that started it, whose part it is to start it again: both orders
    and answers go through sockets that outlive it. One cell is ordered ahead: it is forked, shut in and
    warmed up while the one before it computes.
    """

    def __init__(self, bounds: DecoderLimits) -> None:
        self._bounds = bounds
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._pid = memoryview(mmap.mmap(-1, mmap.PAGESIZE)).cast("q")
        self._ends: tuple[socket.socket, ...] = ()
        self._spare: Cell | None = None
        self._sandbox: Sandbox | None = None
        self._is_owner = True

    @property
    def pid(self) -> int | None:
        """Return the zygote's process id."""
        return self._pid[0] or None

    def start(self) -> Sandbox:
        """Start the zygote unless it runs; what holds in its cells."""
        with self._lock:
            self._ensure_started()
            assert self._sandbox is not None  # noqa: S101  it comes with the zygote
            return self._sandbox

    def look_after(self) -> None:
        """Start the zygote again if it has died, without waiting for it: orders do."""
        if self._process is not None and self._process.poll() is not None:
            self._launch()

    def take(self) -> Cell:
        """A cell that has seen no file."""
        with self._lock:
            cell, self._spare = self._spare, None
            end = time.monotonic() + _BIRTH_SECONDS
            while time.monotonic() < end:
                cell = cell or self._order()
                # a zygote that dies is replaced, and the new one serves what was not lost with it
                if cell.await_birth(_LOOK_SECONDS):
                    if not cell.is_over():
                        return cell
                    cell.close()
                    cell = None
                self._ensure_started()
            if cell is not None:
                cell.close()
            self._kill()
            raise DecoderUnavailable("The decoding processes' zygote does not answer.")

    def prepare(self) -> None:
        """Order the next cell ahead, unless one waits already."""
        with self._lock, contextlib.suppress(DecoderUnavailable):
            self._spare = self._spare or self._order()

    def close(self) -> None:
        """End the zygote, and with it every cell."""
        with self._lock:
            self._kill()
            ends, self._ends = self._ends, ()
            for end in ends:
                end.close()

    def share(self) -> None:
        """Go on in a fork: cells of its own, of the zygote that is there."""
        self._lock, self._is_owner = threading.Lock(), False
        self._process = self._spare = None

    def _order(self) -> Cell:
        self._ensure_started()
        cell = Cell()
        try:
            cell.order_from(self._ends[0])
        except OSError as error:
            cell.close()
            raise DecoderUnavailable("The decoding processes' zygote takes no orders.") from error
        return cell

    def _ensure_started(self) -> None:
        if not self._is_owner or (self._process is not None and self._process.poll() is None):
            return
        self._launch()
        try:
            self._sandbox = self._await_ready()
        except DecoderUnavailable:
            self._kill()
            raise

    def _launch(self) -> None:
        self._kill()
        self._ends = self._ends or socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        ours, its = self._ends
        with contextlib.suppress(BlockingIOError):
            while True:  # what the one before may have said last
                ours.recv(_LONGEST_WORD, socket.MSG_DONTWAIT)
        self._process = subprocess.Popen(  # noqa: S603  our own interpreter, our own module
            [*build_command("worker.decode"), *_arguments(self._bounds)],
            stdin=its.fileno(),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=build_environment(),
            start_new_session=True,  # Ctrl-C in a terminal is for the parent alone
        )
        self._pid[0] = self._process.pid

    def _await_ready(self) -> Sandbox:
        end, ready, ours = time.monotonic() + _START_SECONDS, b"", self._ends[0]
        while not ready and time.monotonic() < end and self._process and self._process.poll() is None:
            ready = ours.recv(_LONGEST_WORD) if _poll(ours, 0.02) else b""
        try:
            told = json.loads(ready or b"{}")
            if told.get("ready") is True and told.get("threads") == 1:
                return Sandbox(**told["sandbox"])
        except (ValueError, TypeError) as error:
            raise DecoderUnavailable(f"The decoding processes do not start: {error!r}.") from error
        raise DecoderUnavailable(f"The decoding processes do not start: {self._autopsy(told)}.")

    def _autopsy(self, told: dict[str, Any]) -> str:
        if told:
            return "they do not keep to the protocol"
        assert self._process is not None  # noqa: S101  it has just been started
        code = self._process.poll()
        if code is None:
            return f"they are not ready after {_START_SECONDS:g} s"
        return f"ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"

    def _kill(self) -> None:
        """End the zygote; a fork leaves it to its owner to notice."""
        spare, self._spare = self._spare, None
        if spare is not None:
            spare.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process, self._pid[0] = None, 0
        elif not self._is_owner and self._pid[0]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._pid[0], signal.SIGKILL)


def _arguments(bounds: DecoderLimits) -> list[str]:
    return [
        *("--parent", str(os.getpid())),
        *("--memory-bytes", str(bounds.memory_bytes)),
        *("--cpu-seconds", str(bounds.cpu_seconds)),
    ]
