"""Files of hostile bytes, each read by a cell of its own; no answer is believed before it is checked."""

import contextlib
import json
import mmap
import os
import select
import signal
import socket
import stat
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, Self, TypeVar

from radiometry.findings import files
from radiometry.frame import Frame, FrameHeader, proof
from store.blobs import BlobDamaged, StoredFile
from store.sandbox import Sandbox, build_command, build_environment
from worker.decode import answers, messages
from worker.decode.limits import NOT_SHUT_IN, DecoderLimits

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
    """The parent's ends of one cell: requests go into `talk`, and answers come out of it."""

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
            [
                *build_command("worker.decode"),
                *("--parent", str(os.getpid()), "--memory-bytes", str(self._bounds.memory_bytes)),
                *("--cpu-seconds", str(self._bounds.cpu_seconds)),
            ],
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
        if (code := self._process.poll()) is None:
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


_PREVIEW_BYTES: Final = 64 << 20
_PREVIEW_SIDE_PX: Final = 1600
# What only the process itself, or a limit that it ran into, brings about.
_OWN_SIGNALS: Final = frozenset(
    {
        *(signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGABRT),
        *(signal.SIGSYS, signal.SIGTRAP, signal.SIGXCPU, signal.SIGXFSZ),
    }
)
# A process that used less of its time than this stood still for reasons that are not its file's.
_BUSY_SHARE: Final = 0.25

_T = TypeVar("_T")
_Identity = tuple[int, int, int, int]

Readable = Path | StoredFile  # a stored file is proven where it is read, any other is taken as it is


class _Ended(Exception):  # noqa: N818  it says what happened
    words: str

    def __init__(self, stage: str, reason: str) -> None:
        self.stage, self.reason = stage, reason
        self.message = self.words.format(f"while it read this file ({stage}: {reason})")
        super().__init__(self.message)


class DecoderCrashed(_Ended):
    """The decoding process ended while it read this file: the file is hostile, or a decoder is wrong."""

    words = "The decoder failed {}. The file may be damaged."


class DecoderKilled(_Ended):
    """Somebody else ended the decoding process, perhaps the kernel, short of memory: no word on the file."""

    words = "The decoder was ended from outside {}. That says nothing about the file: try again."


class DecoderPool:
    """The decoders of one process and its forks: one file is read at a time.

    Every method raises InputRejected for a file that cannot be used, BlobDamaged for a stored one that is not
    what was uploaded, FileNotFoundError for one that is not there, DecoderCrashed for one that ended its
    cell, and DecoderKilled where somebody else did so twice.
    """

    def __init__(self, limits: DecoderLimits | None = None) -> None:
        self._limits = limits or DecoderLimits()
        self._nursery = Nursery(self._limits)
        self.start = self._nursery.start
        self.look_after = self._nursery.look_after
        self._begin()

    def share(self) -> None:
        """Go on in a fork, whose cells are its own: the answers of the parent's would be mixed up."""
        self._nursery.share()
        self._begin()

    def _begin(self) -> None:
        self._lock = threading.Lock()
        self._held: dict[Path, _Decoder | None] = {}
        self._reading: _Decoder | None = None

    @contextmanager
    def hold(self, file: Readable) -> Iterator[None]:
        """Keep a file's cell between its reads; without that each read has a cell of its own."""
        path = path_of(file)
        if path in self._held:
            yield
            return
        self._held[path] = None
        try:
            yield
        finally:
            if (kept := self._held.pop(path)) is not None:
                kept.close()

    def read_header(self, file: Readable) -> FrameHeader:
        return self._read(file, lambda decoder: decoder.read_header())

    def read_window(self, file: Readable, window: tuple[int, int, int, int]) -> Frame:
        """``window`` : (row0, col0, height, width) in the visible area."""
        return self._read(file, lambda decoder: decoder.read_window(window))

    def inspect(self, file: Readable, longest_side_px: int = _PREVIEW_SIDE_PX) -> tuple[bytes, proof.Proof]:
        """Every row is read: a PNG, and what vouches for the pixels."""
        return self._read(file, lambda decoder: decoder.inspect(longest_side_px))

    def pids(self) -> list[int]:
        """Return the process ids of the zygote and of the cells that live, as far as they are known."""
        cells = {each.pid for each in (self._reading, *self._held.values()) if each}
        return [pid for pid in (self._nursery.pid, *cells) if pid is not None]

    def close(self) -> None:
        for kept in filter(None, self._held.values()):
            kept.close()
        self._nursery.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _read(self, file: Readable, ask: "Callable[[_Decoder], _T]") -> _T:
        with self._lock:
            path = path_of(file)
            if (decoder := self._held.get(path)) is not None and not decoder.has_open(file):
                decoder.close()
                decoder = None
            self._reading = decoder = decoder or _Decoder(self._nursery, self._limits, file)
            try:
                return ask(decoder)
            finally:
                self._reading = None
                if path in self._held and decoder.pid is not None:
                    self._held[path] = decoder
                else:
                    decoder.close()


class _Decoder:
    def __init__(self, nursery: Nursery, bounds: DecoderLimits, file: Readable) -> None:
        self._nursery, self._bounds, self._file = nursery, bounds, file
        self._cell: Cell | None = None
        self._wall_s = bounds.wall_seconds
        self._identity: _Identity | None = None

    @property
    def pid(self) -> int | None:
        return self._cell.pid if self._cell else None

    def read_header(self) -> FrameHeader:
        answer, _ = self._ask({"do": "read_header"}, 0)
        return self._checked("read_header", lambda: answers.check_header(answer))

    def read_window(self, window: tuple[int, int, int, int]) -> Frame:
        _, _, height, width = window
        most = min(max(0, height) * max(0, width) * 6, messages.MAX_BODY_BYTES)
        answer, body = self._ask({"do": "read_window", "window": list(window)}, most)
        return self._checked("read_window", lambda: answers.check_frame(answer, body, window))

    def inspect(self, longest_side_px: int) -> tuple[bytes, proof.Proof]:
        request = {"do": "inspect", "longest_side_px": longest_side_px}
        answer, body = self._ask(request, _PREVIEW_BYTES)
        return self._checked("inspect", lambda: (answers.check_preview(body), answers.check_proof(answer)))

    def has_open(self, file: Readable) -> bool:
        """Return True if the cell reads this file: the same proof of it, the same bytes under its path."""
        return self._file == file and self._identity == _identify(path_of(file).stat())

    def close(self) -> None:
        """End the cell, and all that it holds."""
        cell, self._cell = self._cell, None
        if cell is not None:
            cell.close()
            # not while the cell computes: on one core with two threads it would be slowed by that
            self._nursery.prepare()

    def _ask(self, request: dict[str, Any], max_body_bytes: int) -> tuple[dict[str, Any], memoryview]:
        """The answer; a file is not blamed before a second cell has met the same end."""
        try:
            return self._ask_once(request, max_body_bytes)
        except DecoderKilled:
            return self._ask_once(request, max_body_bytes)

    def _ask_once(self, request: dict[str, Any], max_body_bytes: int) -> tuple[dict[str, Any], memoryview]:
        stage = str(request["do"])
        try:
            cell = self._deliver(request)
            deadline = time.monotonic() + self._wall_s
            talk = cell.talk.fileno()
            answer, body = messages.receive(talk, deadline=deadline, max_body_bytes=max_body_bytes)
        except TimeoutError:
            raise self._end_late(stage) from None
        except (messages.BrokenMessageError, OSError) as error:
            if self._cell is None:
                raise
            raise self._autopsy(stage, str(error)) from error
        return self._sorted(answer, stage), body

    def _deliver(self, request: dict[str, Any]) -> Cell:
        if self._cell is not None:
            messages.send(self._cell.talk.fileno(), request)
            return self._cell
        descriptor, status = open_file(path_of(self._file))
        try:
            self._cell = self._nursery.take()
            self._cell.give(descriptor)
        finally:
            os.close(descriptor)
        self._identity = _identify(status)
        self._wall_s = self._bounds.wall_seconds_of(status.st_size)
        digests = self._file.blob.digests.hex() if isinstance(self._file, StoredFile) else None
        messages.send(self._cell.talk.fileno(), {**request, "digests": digests})
        return self._cell

    def _sorted(self, answer: dict[str, Any], stage: str) -> dict[str, Any]:
        """The answer if it is one; a refusal or a failure is raised."""
        if "refused" in answer:
            raise self._checked(stage, lambda: answers.check_refusal(answer))
        if "damaged" in answer and isinstance(self._file, StoredFile):
            raise BlobDamaged(self._file.blob.sha256)
        if "failed" in answer:
            self.close()
            raise DecoderCrashed(stage, str(answer["failed"])[:200])
        return answer

    def _checked(self, stage: str, check: Callable[[], _T]) -> _T:
        """A process that answers nonsense is not asked again."""
        try:
            return check()
        except messages.BrokenMessageError as error:
            self._kill()
            raise DecoderCrashed(stage, str(error)) from error

    def _end_late(self, stage: str) -> DecoderCrashed | DecoderKilled:
        """End a process that took too long, and find whose fault that was."""
        busy_s = _read_cpu_s(self.pid)
        self._kill()
        if busy_s < _BUSY_SHARE * self._wall_s:
            return DecoderKilled(stage, f"it stood still for {self._wall_s:g} s")
        return DecoderCrashed(stage, f"it took longer than {self._wall_s:g} s")

    def _autopsy(self, stage: str, fallback: str) -> DecoderCrashed | DecoderKilled | DecoderUnavailable:
        """How the process ended, once its socket is closed."""
        cell, self._cell = self._cell, None
        assert cell is not None  # noqa: S101  it has just been asked
        code = cell.hear_end()
        cell.kill()
        if code is None:
            return DecoderKilled(stage, "its zygote is gone")
        if code == NOT_SHUT_IN:
            return DecoderUnavailable("A decoding process could not shut itself in as the first one did.")
        if code < 0:
            ended = signal.Signals(-code)
            kind = DecoderCrashed if ended in _OWN_SIGNALS else DecoderKilled
            return kind(stage, f"ended by {ended.name}")
        return DecoderCrashed(stage, fallback)

    def _kill(self) -> None:
        cell, self._cell = self._cell, None
        if cell is not None:
            cell.kill()


def path_of(file: Readable) -> Path:
    return file.path if isinstance(file, StoredFile) else file


def open_file(path: Path) -> tuple[int, os.stat_result]:
    """Open a regular file for reading only; anything else is refused, and nothing can make this wait."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    status = os.fstat(descriptor)
    if not stat.S_ISREG(status.st_mode):
        os.close(descriptor)
        raise files.NOT_A_RAW_FILE.refuse("This is no file of its own.")
    return descriptor, status


def _identify(status: os.stat_result) -> _Identity:
    """Return what changes when a path leads to other bytes."""
    return (status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)


def _read_cpu_s(pid: int | None) -> float:
    """The processor's time that a process has used; its zygote has not let go of its pid yet."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return float("inf")
