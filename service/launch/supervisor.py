"""Keeps child processes alive: starts again what dies or hangs, and takes all of them down in order."""

import ctypes
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import BinaryIO, Self

from radiometry.records import Record
from service.launch.folder import has_room, report
from store.pulse import read_beat

_PR_SET_PDEATHSIG = 1


def die_with_parent(sig: signal.Signals = signal.SIGKILL) -> Callable[[], None]:
    """Return a `preexec_fn`: the kernel signals the child when its starting thread dies, the main one."""
    # Made here, since between fork and exec a child of a process with threads may take no lock.
    return _tie(os.getpid(), sig)


def follow_make() -> None:
    """Die with the `make` that runs this: whoever kills it with -9 holds no other handle on us."""
    parent = os.getppid()
    try:
        name = Path(f"/proc/{parent}/comm").read_text(encoding="utf-8").strip()
    except OSError:
        return
    if name in {"make", "gmake"}:
        _tie(parent, signal.SIGKILL)()


def _tie(parent: int, sig: signal.Signals) -> Callable[[], None]:
    if sys.platform != "linux":
        return lambda: None
    prctl = ctypes.CDLL(None, use_errno=True).prctl

    def tie() -> None:
        prctl(_PR_SET_PDEATHSIG, int(sig), 0, 0, 0)
        # The parent may have died before the line above: then no signal will ever come.
        if os.getppid() != parent:
            os._exit(1)

    return tie


_STOP = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Signals:
    """Counts the requests to stop; use as a context manager, in the main thread."""

    def __init__(self) -> None:
        self.stops = 0

    def __enter__(self) -> Self:
        # The handlers themselves only count: they may interrupt any line, so they must take no lock.
        self._ear, self._mouth = socket.socketpair()
        self._ear.setblocking(False)
        self._mouth.setblocking(False)
        self._before_fd = signal.set_wakeup_fd(self._mouth.fileno(), warn_on_full_buffer=False)
        self._before = {number: signal.signal(number, self._count) for number in _STOP if _wanted(number)}
        self._before[signal.SIGCHLD] = signal.signal(signal.SIGCHLD, lambda *_: None)
        return self

    def wait(self, timeout_s: float) -> None:
        """Sleep for so long, or until the next signal."""
        select.select([self._ear], [], [], max(timeout_s, 0.0))
        with suppress(BlockingIOError):
            self._ear.recv(4096)

    def __exit__(self, *_error: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(self._before_fd)
        self._ear.close()
        self._mouth.close()

    def _count(self, _number: int, _frame: FrameType | None) -> None:
        self.stops += 1


def _wanted(number: signal.Signals) -> bool:
    # Whoever runs this under nohup wants it to outlive the terminal.
    return not (number == signal.SIGHUP and signal.getsignal(number) == signal.SIG_IGN)


DEATHS_ALLOWED = 5
WITHIN_S = 60.0
FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 8.0
START_WITHIN_S = 120.0  # how long a part may take to its first beat: it loads much, perhaps from a slow disk
_LONGEST_TURN_S = 3.0
"""The launcher looks once a second; beyond this, or half the patience, it was stopped, perhaps parts too."""
LOG_BYTES = 16 << 20


class GaveUp(Exception):  # noqa: N818 (it says what happened)
    """A part died too often; the message names the log to read."""


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
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float = 60.0) -> int:
        deadline = time.monotonic() + timeout
        while (code := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(f"process {self.pid}", timeout)
            time.sleep(0.01)
        return code

    def terminate(self) -> None:
        if self.poll() is None:
            os.kill(self.pid, signal.SIGTERM)


Process = subprocess.Popen[bytes] | Forked


class Part(Record):
    """A process that has to run."""

    name: str
    command: Sequence[str] = ()
    run: Callable[[], Process] | None = None
    """Starts it in place of the command, with this process's own output."""
    stop_within_s: float = 10.0  # how long it may take to finish in order before it is killed
    knows_key: bool = False
    """It finds the bootstrap key in STILB_KEY; those that read strangers' bytes do not."""
    serves_others: bool = False  # it is stopped only after the parts that need it
    stop: Callable[[], object] | None = None  # asks it to stop where a signal takes longer
    has_pulse: bool = False
    """It touches the file in STILB_PULSE while its work goes on, and is killed when it does not."""


class Patience(Record):
    """How long a part may do nothing, and how long it may be stopped amid a writing transaction [s]."""

    hang_s: float
    lock_s: float = 0.0
    find_stopped_writer: Callable[[], int | None] = lambda: None  # the process that is


@dataclass
class _Child:
    part: Part
    log: Path
    pulse: Path
    process: Process | None = None
    start_at: float = 0.0
    deaths: deque[float] = field(default_factory=deque)
    beat: int | None = None  # the last beat that was seen
    seen_at: float = 0.0  # when it was new, on the launcher's clock
    patience_s: float = START_WITHIN_S
    free_at: float = 0.0  # when it was last seen not to be stopped amid a writing transaction


class AwakeClock:
    """Seconds that add up turn by turn, each at most `longest_turn_s`: who stood still counts nothing."""

    def __init__(self, longest_turn_s: float, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._longest_turn_s = longest_turn_s
        self._clock = clock
        self._turned = clock()
        self.now_s = 0.0

    def turn(self) -> float:
        now = self._clock()
        self.now_s += min(now - self._turned, self._longest_turn_s)
        self._turned = now
        return self.now_s


@dataclass(kw_only=True)
class Supervisor:
    """Call every method from the main thread: the children's lives depend on the thread that starts them."""

    data: Path
    patience: Patience
    environment: Mapping[str, str] = field(default_factory=dict)
    key: str = ""
    lock: int = -1
    pulses: Path | None = None

    def __post_init__(self) -> None:
        self._children: list[_Child] = []
        self._clock = AwakeClock(min(_LONGEST_TURN_S, self.patience.hang_s / 2))
        self._was_full = False

    def start(self, part: Part) -> None:
        pulse = (self.pulses or self.data / "run") / f"{part.name}.pulse"
        child = _Child(part, self.data / "logs" / f"{part.name}.log", pulse)
        if part.run is None:
            _rotate(child.log)
        child.pulse.parent.mkdir(exist_ok=True)
        self._children.append(child)
        self._spawn(child)

    def look_after(self) -> float:
        """Start what died or hung and is due again; return how long until the next is due [s]."""
        now = time.monotonic()
        self._clock.turn()
        stopped = self.patience.find_stopped_writer()
        for child in self._children:
            if child.process is not None and child.process.poll() is None and child.part.has_pulse:
                self._feel(child, child.process)
                self._free_lock(child, child.process, stopped)
            if child.part.run is None:
                _rotate(child.log)
            if child.process is not None and child.process.poll() is not None:
                self._bury(child, child.process, now)
            if child.process is None and child.start_at <= now:
                self._spawn_again(child, now)
        return min((child.start_at - now for child in self._children if child.process is None), default=1.0)

    def stop(self, signals: Signals) -> None:
        """Stop those that need others first; who takes too long is killed, or all at a second request."""
        stops = signals.stops
        for serving in (False, True):
            running = [
                (child.part, child.process)
                for child in self._children
                if child.process is not None and child.part.serves_others == serving
            ]
            for part, process in running:
                if part.stop is not None:
                    part.stop()
                process.terminate()
            started = time.monotonic()
            for part, process in running:
                while process.poll() is None and signals.stops <= stops:
                    left_s = started + part.stop_within_s - time.monotonic()
                    if left_s <= 0:
                        report(f"{part.name} did not stop within {part.stop_within_s:g} s and is killed")
                        break
                    signals.wait(min(left_s, 0.2))
                _kill_group(process)
                process.wait()

    def _spawn(self, child: _Child) -> None:
        added = {"STILB_KEY": self.key} if child.part.knows_key else {}
        if child.part.has_pulse:
            added["STILB_PULSE"] = str(child.pulse)
        # What its predecessor left there is not its own beat.
        child.beat, child.seen_at = read_beat(child.pulse), self._clock.now_s
        child.patience_s = START_WITHIN_S
        if child.part.run is not None:
            child.process = child.part.run()
            return
        with _open_log(child.log) as log:
            child.process = subprocess.Popen(  # noqa: S603 (our own commands)
                child.part.command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**self.environment, **added},
                pass_fds=[self.lock],
                # A group of its own: Ctrl-C reaches the launcher only, which then stops all in order.
                process_group=0,
                preexec_fn=die_with_parent(),  # noqa: PLW1509 (it takes no lock)
            )

    def _spawn_again(self, child: _Child, now: float) -> None:
        try:
            self._spawn(child)
        except OSError as error:
            # No memory, no room, no process free: a passing fault of the machine.
            child.start_at = now + LONGEST_PAUSE_S
            report(f"{child.part.name} could not be started and is tried again: {error}")

    def _feel(self, child: _Child, process: Process) -> None:
        """Kill a part whose pulse has not changed for too long while the launcher looked."""
        beat = read_beat(child.pulse)
        if beat != child.beat:
            child.beat, child.seen_at, child.patience_s = beat, self._clock.now_s, self.patience.hang_s
        elif self._clock.now_s - child.seen_at > child.patience_s:
            if not has_room(self.data):
                # Perhaps it cannot even leave its beat.
                child.seen_at = self._clock.now_s
                return
            self._kill(child, process, f"has done nothing for {child.patience_s:g} s")

    def _free_lock(self, child: _Child, process: Process, stopped: int | None) -> None:
        """Kill a part that was stopped amid a writing transaction: all others wait for it."""
        with suppress(ProcessLookupError):
            if stopped is None or os.getpgid(stopped) != process.pid:
                child.free_at = self._clock.now_s
        if self._clock.now_s - child.free_at > self.patience.lock_s:
            child.free_at = self._clock.now_s
            self._kill(child, process, "was stopped while it held the write lock of the database")

    def _kill(self, child: _Child, process: Process, why: str) -> None:
        report(f"{child.part.name} {why} and is killed")
        _kill_group(process)
        with suppress(subprocess.TimeoutExpired):
            process.wait(1.0)

    def _bury(self, child: _Child, process: Process, now: float) -> None:
        # What it had started itself must not work on beside its successor.
        _kill_group(process)
        child.process = None
        if not has_room(self.data):
            self._wait_for_room(child, now)
            return
        self._was_full = False
        child.deaths.append(now)
        while child.deaths[0] < now - WITHIN_S:
            child.deaths.popleft()
        how = _how_it_ended(process.wait())
        if len(child.deaths) > DEATHS_ALLOWED:
            raise GaveUp(
                f"{child.part.name} {how}, {len(child.deaths)} times within {WITHIN_S:g} s: read {child.log}"
            )
        pause_s = min(FIRST_PAUSE_S * 2 ** (len(child.deaths) - 1), LONGEST_PAUSE_S)
        child.start_at = now + pause_s
        where = "" if child.part.run else f" (log: {child.log})"
        report(f"{child.part.name} {how} and is started again{where}")

    def _wait_for_room(self, child: _Child, now: float) -> None:
        """Try again without counting: nothing that died on a full disk is broken for that."""
        child.deaths.clear()
        child.start_at = now + LONGEST_PAUSE_S
        if not self._was_full:
            report(f"the disk of {self.data} is full: what ends is started again until there is room")
        self._was_full = True


def _how_it_ended(code: int) -> str:
    if code >= 0:
        return f"ended with exit code {code}"
    with suppress(ValueError):
        return f"was killed by {signal.Signals(-code).name}"
    return f"was killed by signal {-code}"


def _kill_group(process: Process) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _open_log(path: Path) -> BinaryIO:
    """Open a log, or nothing where even an empty one finds no room: a part runs without its log too."""
    try:
        return path.open("ab")
    except OSError:
        return Path(os.devnull).open("ab")


def _rotate(log: Path) -> None:
    """Keep the last 16 MiB of a log apart and empty it; a running part goes on at its beginning."""
    log.parent.mkdir(parents=True, exist_ok=True)
    with suppress(OSError):
        if log.stat().st_size > LOG_BYTES:
            with suppress(OSError):
                shutil.copyfile(log, log.with_suffix(".log.1"))
            os.truncate(log, 0)
