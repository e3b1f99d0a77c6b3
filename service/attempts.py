"""Limit of sign-in attempts: a wait that doubles with each failure, for the one who fails.

It is kept in memory, and the processes of a service tell each other every second. What it bounds is noise: a
key has 256 random bits, which nobody finds by trying.
"""

import hashlib
import ipaddress
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import astuple, dataclass
from threading import Lock
from typing import Any, Final

FREE: Final = 5
"""Failures without a wait: people mistype."""
LONGEST_WAIT_S: Final = 300.0
FORGOTTEN_AFTER_S: Final = 900.0
_MOST_KEPT: Final = 10_000
_MOST_TOLD: Final = 500


@dataclass(frozen=True)
class _Failures:
    count: int
    last_at: float

    def wait_s(self, free: int) -> float:
        """Return how long all attempts are refused after the last failure."""
        over = self.count - free
        return min(2.0 ** min(over, 10), LONGEST_WAIT_S) if over >= 0 else 0.0


class Attempts:
    """Failures by address and by key, and the keys that have lately been right.

    A key that was right lately is not kept waiting because somebody else at its address fails, as behind a
    proxy that hides addresses.
    """

    def __init__(self, clock: Callable[[], float] = time.time, *, free: int = FREE) -> None:
        self._clock = clock
        self._free = free
        self._lock = Lock()
        self._failures: OrderedDict[str, _Failures] = OrderedDict()
        self._others: dict[str, list[_Failures]] = {}
        self._right: OrderedDict[bytes, None] = OrderedDict()

    def fail(self, who: str) -> None:
        """Count a failure of an address, or of a key that may not sign in."""
        with self._lock:
            count = self._count(who) + 1
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
        """Return the newest failures that this process has seen, for the others."""
        with self._lock:
            newest = list(self._failures.items())[-_MOST_TOLD:]
        over = self._clock() - LONGEST_WAIT_S
        return {who: astuple(each) for who, each in newest if each.last_at > over}

    def hear(self, others: Iterable[Mapping[str, tuple[int, float]]]) -> None:
        """Count with what the other processes have seen."""
        heard: dict[str, list[_Failures]] = {}
        for each in others:
            for who, failures in each.items():
                heard.setdefault(who, []).append(_Failures(*failures))
        with self._lock:
            self._others = heard

    def trust(self, secret: str) -> None:
        """Remember that a key was right."""
        name = _hash(secret)
        with self._lock:
            self._right[name] = None
            _keep_newest(self._right, name)

    def is_trusted(self, secret: str) -> bool:
        """Return whether this very key was right lately."""
        with self._lock:
            return _hash(secret) in self._right

    def _count(self, who: str) -> int:
        found = self._failures.get(who)
        return 0 if found is None or self._is_forgotten(found) else found.count

    def _is_forgotten(self, failures: _Failures) -> bool:
        return self._clock() > failures.last_at + failures.wait_s(self._free) + FORGOTTEN_AFTER_S


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
