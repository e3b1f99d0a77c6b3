"""Keeps child processes alive: starts them again when they die, and takes all of them down in order."""

import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from service.launch.lifeline import die_with_parent
from service.launch.signals import Signals

DEATHS_ALLOWED = 5
WITHIN_S = 60.0
FIRST_PAUSE_S = 0.1
LONGEST_PAUSE_S = 8.0
LOG_BYTES = 16 << 20


class GaveUp(Exception):  # noqa: N818 (it says what happened)
    """A part died too often; the message names the log to read."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A process that has to run."""

    name: str
    command: Sequence[str]
    stop_within_s: float = 10.0
    """How long it may take to finish in order before it is killed."""
    knows_key: bool = False
    """It finds the bootstrap key in STILB_KEY; those that read strangers' bytes do not."""
    serves_others: bool = False
    """It is stopped only after the parts that need it."""
    after_death: Callable[[Path], None] | None = None
    """Called with the log's path before it is started again."""


@dataclass
class _Child:
    part: Part
    log: Path
    process: subprocess.Popen[bytes] | None = None
    start_at: float = 0.0
    deaths: deque[float] = field(default_factory=deque)


class Supervisor:
    """Call every method from the main thread: the children's lives hang on the thread that starts them."""

    def __init__(
        self, *, environment: Mapping[str, str], key: str, logs: Path, lock: int, say: Callable[[str], None]
    ) -> None:
        self._environment = dict(environment)
        self._key = key
        self._logs = logs
        self._lock = lock
        self._say = say
        self._children: list[_Child] = []

    def start(self, part: Part) -> None:
        child = _Child(part, self._logs / f"{part.name}.log")
        _rotate(child.log)
        self._children.append(child)
        self._spawn(child)

    def look_after(self) -> float:
        """Start what died and is due again; return how long until the next is due [s]."""
        now = time.monotonic()
        for child in self._children:
            if child.process is not None and child.process.poll() is not None:
                self._bury(child, child.process, now)
            if child.process is None and child.start_at <= now:
                self._spawn(child)
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
            for _, process in running:
                process.terminate()
            started = time.monotonic()
            for part, process in running:
                while process.poll() is None and signals.stops <= stops:
                    left_s = started + part.stop_within_s - time.monotonic()
                    if left_s <= 0:
                        self._say(f"{part.name} did not stop within {part.stop_within_s:g} s and is killed")
                        break
                    signals.wait(min(left_s, 0.2))
                _kill_group(process)
                process.wait()

    def _spawn(self, child: _Child) -> None:
        key = {"STILB_KEY": self._key} if child.part.knows_key else {}
        with child.log.open("ab") as log:
            child.process = subprocess.Popen(  # noqa: S603 (our own commands)
                child.part.command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env=self._environment | key,
                pass_fds=[self._lock],
                # A group of its own: Ctrl-C reaches the launcher only, which then stops all in order.
                process_group=0,
                preexec_fn=die_with_parent(),  # noqa: PLW1509 (it takes no lock)
            )

    def _bury(self, child: _Child, process: subprocess.Popen[bytes], now: float) -> None:
        # What it had started itself must not work on beside its successor.
        _kill_group(process)
        child.process = None
        child.deaths.append(now)
        while child.deaths[0] < now - WITHIN_S:
            child.deaths.popleft()
        how = _how_it_ended(process.returncode)
        if len(child.deaths) > DEATHS_ALLOWED:
            raise GaveUp(
                f"{child.part.name} {how}, {len(child.deaths)} times within {WITHIN_S:g} s: read {child.log}"
            )
        pause_s = min(FIRST_PAUSE_S * 2 ** (len(child.deaths) - 1), LONGEST_PAUSE_S)
        child.start_at = now + pause_s
        self._say(f"{child.part.name} {how} and is started again (log: {child.log})")
        if child.part.after_death is not None:
            child.part.after_death(child.log)


def _how_it_ended(code: int) -> str:
    if code >= 0:
        return f"ended with exit code {code}"
    with suppress(ValueError):
        return f"was killed by {signal.Signals(-code).name}"
    return f"was killed by signal {-code}"


def _kill_group(process: subprocess.Popen[bytes]) -> None:
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def _rotate(log: Path) -> None:
    log.parent.mkdir(parents=True, exist_ok=True)
    if log.exists() and log.stat().st_size > LOG_BYTES:
        log.replace(log.with_suffix(".log.1"))
