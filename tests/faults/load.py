"""What a drill asks of the service while it suffers: uploads, measurements, a fit, until all are answered."""

import hashlib
import queue
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from random import Random

import stilb
from tests.support.fieldwork import Shot, Team

_ASKERS = 4
_AGAIN_AFTER_S = 0.5
_REFUSALS_ALLOWED = 3
_SLOW_BYTES = 3 << 20
_SLOW_CHUNK_S = 0.7
_LOOK_UP_EVERY_S = 0.05


@dataclass(frozen=True, kw_only=True)
class Trouble:
    at: float
    asked: str
    code: str
    retryable: bool


@dataclass(frozen=True, kw_only=True)
class Base:
    """What is there before the fault: a campaign that was fitted in peace."""

    campaign: stilb.Campaign
    frames: dict[str, stilb.Frame]
    version: stilb.Calibration


class Load:
    """One row's requests. Each is repeated as a user would who sees it fail, until it succeeds.

    ``received`` are the card's frames as they were acknowledged, ``measured`` the measurements, by the names
    of their files; ``refused`` was given up after the same lasting refusal three times.
    """

    def __init__(self, team: Team, base: Base, card: Sequence[Shot], rng: Random, *, slow: bool):
        self.team = team
        self.base = base
        self.campaign = team.campaign()
        self.received: dict[str, stilb.Frame] = {}
        self.measured: dict[str, stilb.Measurement] = {}
        self.fitted: list[str] = []
        self.troubles: list[Trouble] = []
        self.refused: list[Trouble] = []
        self.looked_up = 0
        self._slow = slow
        lit = [name for name, frame in base.frames.items() if frame.role == "light"]
        self._items: list[tuple[str, Callable[[], None]]] = [
            *((f"send {shot.path.name}", lambda shot=shot: self._send(shot)) for shot in card),
            *((f"measure {name}", lambda name=name: self._measure(name)) for name in lit),
            ("fit", self._fit),
        ]
        rng.shuffle(self._items)
        self._waiting: queue.SimpleQueue[tuple[str, Callable[[], None]] | None] = queue.SimpleQueue()
        self._open: set[str] = set()
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        askers = [*([self._ask] * _ASKERS), *([self._look_up] if slow else [])]
        self._threads = [threading.Thread(target=ask, daemon=True) for ask in askers]

    def __enter__(self):
        self.ask_all()
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_):
        self._stopped.set()
        for _ in self._threads:
            self._waiting.put(None)

    def ask_all(self) -> None:
        """Ask for everything, also for what was answered before: so does who restored a backup."""
        with self._lock:
            for name, item in self._items:
                self._open.add(name)
                self._waiting.put((name, item))

    def unanswered(self) -> set[str]:
        with self._lock:
            return set(self._open)

    @property
    def answered(self) -> int:
        return len(self._items) - len(self.unanswered())

    def _ask(self) -> None:
        while (item := self._waiting.get()) is not None and not self._stopped.is_set():
            name, call = item
            try:
                self._insist(name, call)
            except Exception:
                if self._stopped.is_set():
                    return  # its client was closed
                raise
            with self._lock:
                self._open.discard(name)

    def _look_up(self) -> None:
        """Ask again and again for K, as a program does that measures with it."""
        try:
            while not self._stopped.wait(_LOOK_UP_EVERY_S):
                self._insist("look up K", self._look_up_once)
        except Exception:
            if not self._stopped.is_set():  # its client was closed
                raise

    def _look_up_once(self) -> None:
        found = self.team.client.coefficients(self.base.campaign.camera_id, name="luminance_k")
        assert found, "no K is in force"
        self.looked_up += 1

    def _insist(self, name: str, call: Callable[[], None]) -> None:
        refusals = 0
        while not self._stopped.is_set():
            try:
                call()
            except stilb.Problem as problem:
                trouble = Trouble(
                    at=time.monotonic(), asked=name, code=problem.code, retryable=problem.retryable
                )
                self.troubles.append(trouble)
                refusals += not problem.retryable
                if refusals == _REFUSALS_ALLOWED:
                    self.refused.append(trouble)
                    return
                self._stopped.wait(_AGAIN_AFTER_S)
            else:
                return

    def _send(self, shot: Shot) -> None:
        def linger(_: stilb.Progress) -> None:
            if self._slow:
                time.sleep(_SLOW_CHUNK_S)

        frame = self.team.client.push(
            self.campaign.id, shot.path, role=shot.role, scene=shot.scene, on_progress=linger
        )
        self.received[shot.path.name] = frame

    def _measure(self, name: str) -> None:
        found = self.team.client.measure(self.base.frames[name].id, calibration_id=self.base.version.id)
        self.measured[name] = found

    def _fit(self) -> None:
        # The tolerance changes the verdict and no coefficient: another version with the same K.
        self.fitted.append(self.team.client.calibrate(self.base.campaign.id, tolerance=0.05).id)


def prepare(team: Team, shots: Sequence[Shot]) -> Base:
    """A campaign that is uploaded, read, fitted and published in peace."""
    campaign = team.campaign()
    frames = team.push(campaign, list(shots))
    for frame in frames:
        team.client.wait(frame.job_id, timeout_s=90)
    version = team.client.calibrate(campaign.id)
    team.client.publish(version.id, valid_from=datetime(2020, 1, 1, tzinfo=UTC), reason="checked in peace")
    named = {shot.path.name: frame for shot, frame in zip(shots, frames, strict=True)}
    return Base(campaign=campaign, frames=named, version=version)


def salted(shots: Iterable[Shot], folder: Path, salt: str, *, large: bool) -> list[Shot]:
    """The same pictures in files that no other row has sent: other bytes follow the picture."""
    tail = hashlib.sha256(salt.encode()).digest() * (_SLOW_BYTES // 32 if large else 1)
    folder.mkdir(parents=True)
    found = []
    for shot in shots:
        path = folder / shot.path.name
        path.write_bytes(shot.path.read_bytes() + tail)
        found.append(replace(shot, path=path))
    return found
