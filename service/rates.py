"""How many requests an organisation may send: those of the last minute count.

It is kept in memory. The processes of a service tell each other every second what they have counted.
"""

import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import astuple, dataclass
from threading import Lock
from typing import Final

from radiometry.findings import interface
from service.problems import Problem

_MINUTE_S: Final = 60.0


@dataclass
class _Counts:
    minute: int
    before: int = 0
    now: int = 0


class Rates:
    """Counts the requests of each organisation."""

    def __init__(self, per_minute: int, clock: Callable[[], float] = time.time) -> None:
        self._per_minute = per_minute
        self._clock = clock
        self._lock = Lock()
        self._counts: dict[str, _Counts] = {}
        self._others: dict[str, list[_Counts]] = {}

    def take(self, organisation_id: str) -> None:
        """Count a request in, or refuse it with the time after which there is room for it."""
        with self._lock:
            own, counts, share = self._look(organisation_id)
            used = counts.before * share + counts.now
            if not self._per_minute or used + 1 <= self._per_minute:
                own.now += 1
                return
            wait_s = max(1, math.ceil(self._wait_s(counts, share)))
        raise Problem(
            interface.TOO_MANY_REQUESTS,
            f"You may send {self._per_minute} requests a minute, and have sent {math.ceil(used)}: "
            f"send this one again in {wait_s} s.",
            headers={"Retry-After": str(wait_s)},
            quota="requests_per_minute",
            limit=self._per_minute,
            used=math.ceil(used),
        )

    def used(self, organisation_id: str) -> int:
        """Return how many requests of the last minute there were."""
        with self._lock:
            _, counts, share = self._look(organisation_id)
            return math.ceil(counts.before * share + counts.now)

    def tell(self) -> dict[str, tuple[int, int, int]]:
        """Return what this process has counted lately, for the others."""
        with self._lock:
            minute = self._clock() // _MINUTE_S
            return {name: astuple(each) for name, each in self._counts.items() if each.minute >= minute - 1}

    def hear(self, others: Iterable[Mapping[str, tuple[int, int, int]]]) -> None:
        """Count with what the other processes have counted."""
        heard: dict[str, list[_Counts]] = {}
        for each in others:
            for name, counts in each.items():
                heard.setdefault(name, []).append(_Counts(*counts))
        with self._lock:
            self._others = heard

    def _look(self, organisation_id: str) -> tuple[_Counts, _Counts, float]:
        """Return the own counts, those of all, and the share of the minute before in the last minute."""
        minute, passed_s = divmod(self._clock(), _MINUTE_S)
        counts = self._counts.setdefault(organisation_id, _Counts(int(minute)))
        if counts.minute != minute:
            before = counts.now if minute == counts.minute + 1 else 0
            counts.minute, counts.before, counts.now = int(minute), before, 0
        total = _Counts(int(minute), counts.before, counts.now)
        for other in self._others.get(organisation_id, ()):
            total.before += {minute: other.before, minute - 1: other.now}.get(other.minute, 0)
            total.now += other.now if other.minute == minute else 0
        return counts, total, 1 - passed_s / _MINUTE_S

    def _wait_s(self, counts: _Counts, share: float) -> float:
        room = self._per_minute - 1
        if counts.now <= room:
            return (share - (room - counts.now) / counts.before) * _MINUTE_S
        return (share + 1 - room / counts.now) * _MINUTE_S
