"""Counts of requests, of failed sign-ins, and of the uses of keys."""

import hashlib
import ipaddress
import logging
import math
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import astuple, dataclass
from datetime import timedelta
from threading import Lock
from typing import Any, Final, TypeVar

from sqlalchemy.exc import SQLAlchemyError

from radiometry.findings import interface
from radiometry.records import Record
from service.http.problems import Problem
from store.database import Database
from store.queries.organisations import note_use
from store.tables import ApiKey, WebSession, utc_now

T = TypeVar("T")

STEP: Final = timedelta(minutes=10)
_MOST_KEPT: Final = 10_000


class Uses:
    """Writes a use down once in STEP, whichever process sees it; one that cannot be written is left out."""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._lock = Lock()
        self._tried_at: dict[str, float] = {}

    def note(self, table: type[ApiKey | WebSession], row_id: str) -> None:
        now = utc_now()
        if not self._may_try(row_id):
            return
        try:
            with self._database.writing("service") as session:
                note_use(session, table, row_id, now, unless_after=now - STEP)
        except SQLAlchemyError as error:
            logging.getLogger(__name__).warning("when %s was used cannot be written: %s", row_id, error)

    def _may_try(self, row_id: str) -> bool:
        # a database that takes no writes must not make every request wait for it
        moment = time.monotonic()
        with self._lock:
            if moment < self._tried_at.get(row_id, float("-inf")) + STEP.total_seconds():
                return False
            if len(self._tried_at) >= _MOST_KEPT:
                self._tried_at.clear()
            self._tried_at[row_id] = moment
        return True


def is_unnoted(row: ApiKey | WebSession) -> bool:
    return row.last_used_at is None or row.last_used_at < utc_now() - STEP


FREE: Final = 5  # failures without a wait: people mistype
LONGEST_WAIT_S: Final = 300.0
FORGOTTEN_AFTER_S: Final = 900.0
_MOST_TOLD: Final = 500


class _Failures(Record, kw_only=False):
    count: int
    last_at: float

    def wait_s(self, free: int) -> float:
        """Return how long all attempts are refused after the last failure."""
        over = self.count - free
        return min(2.0 ** min(over, 10), LONGEST_WAIT_S) if over >= 0 else 0.0


class Attempts:
    """Failures by address and by key; who was right lately does not wait for others behind one proxy."""

    def __init__(self, clock: Callable[[], float] = time.time, *, free: int = FREE) -> None:
        self._clock = clock
        self._free = free
        self._lock = Lock()
        self._failures: OrderedDict[str, _Failures] = OrderedDict()
        self._others: dict[str, list[_Failures]] = {}
        self._right: OrderedDict[bytes, None] = OrderedDict()

    def fail(self, who: str) -> None:
        with self._lock:
            found = self._failures.get(who)
            count = (0 if found is None or self._is_forgotten(found) else found.count) + 1
            self._failures[who] = _Failures(count, self._clock())
            _keep_newest(self._failures, who)

    def wait_s(self, who: str) -> float:
        """Return how long an address or key has to wait now [s]; 0 when it may try."""
        with self._lock:
            known = [*self._others.get(who, ()), *filter(None, [self._failures.get(who)])]
            found = [each for each in known if not self._is_forgotten(each)]
        if not found:
            return 0.0
        total = _Failures(sum(each.count for each in found), max(each.last_at for each in found))
        longest_s = total.wait_s(self._free)
        # no longer where the clock has been set back since
        return min(max(0.0, total.last_at + longest_s - self._clock()), longest_s)

    def tell(self) -> dict[str, tuple[int, float]]:
        with self._lock:
            newest = list(self._failures.items())[-_MOST_TOLD:]
        over = self._clock() - LONGEST_WAIT_S
        return {who: astuple(each) for who, each in newest if each.last_at > over}

    def hear(self, others: Iterable[Mapping[str, tuple[int, float]]]) -> None:
        with self._lock:
            self._others = _join(others, _Failures)

    def trust(self, secret: str) -> None:
        name = _hash(secret)
        with self._lock:
            self._right[name] = None
            _keep_newest(self._right, name)

    def is_trusted(self, secret: str) -> bool:
        with self._lock:
            return _hash(secret) in self._right

    def _is_forgotten(self, failures: _Failures) -> bool:
        return self._clock() > failures.last_at + failures.wait_s(self._free) + FORGOTTEN_AFTER_S


def _join(others: Iterable[Mapping[str, Any]], kind: Callable[..., T]) -> dict[str, list[T]]:
    heard: dict[str, list[T]] = {}
    for each in others:
        for name, counted in each.items():
            heard.setdefault(name, []).append(kind(*counted))
    return heard


def name_address(host: str | None) -> str:
    """Return what stands for an address: of IPv6 the network, of which one subscriber has all."""
    try:
        address = ipaddress.ip_address(host or "")
    except ValueError:
        return host or "unknown"
    if isinstance(address, ipaddress.IPv6Address):
        return str(ipaddress.ip_network((address, 64), strict=False))
    return str(address)


def _keep_newest(kept: OrderedDict[Any, Any], newest: object) -> None:
    kept.move_to_end(newest)
    while len(kept) > _MOST_KEPT:
        kept.popitem(last=False)


def _hash(secret: str) -> bytes:
    return hashlib.sha256(secret.encode("utf-8", "surrogatepass")).digest()


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
        with self._lock:
            _, counts, share = self._look(organisation_id)
            return math.ceil(counts.before * share + counts.now)

    def tell(self) -> dict[str, tuple[int, int, int]]:
        with self._lock:
            minute = self._clock() // _MINUTE_S
            return {name: astuple(each) for name, each in self._counts.items() if each.minute >= minute - 1}

    def hear(self, others: Iterable[Mapping[str, tuple[int, int, int]]]) -> None:
        with self._lock:
            self._others = _join(others, _Counts)

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
