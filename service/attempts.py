"""How often somebody may try to sign in: a wait that doubles with each failure, for the one who fails.

It is kept in memory, per process of the service: what it bounds is noise. A key has 256 random bits, which
nobody finds by trying.
"""

import hashlib
import ipaddress
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from threading import Lock
from typing import Any, Final

FREE: Final = 5
"""Failures without a wait: people mistype."""
LONGEST_WAIT_S: Final = 300.0
FORGOTTEN_AFTER_S: Final = 900.0
_MOST_KEPT: Final = 10_000


@dataclass(frozen=True)
class _Failures:
    count: int
    last_at: float

    @property
    def wait_until(self) -> float:
        over = self.count - FREE
        return self.last_at + (min(2.0**over, LONGEST_WAIT_S) if over >= 0 else 0.0)


class Attempts:
    """Failures by address and by key, and the keys that have lately been right.

    A key that was right lately is not kept waiting because somebody else at its address fails, as behind a
    proxy that hides addresses.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = Lock()
        self._failures: OrderedDict[str, _Failures] = OrderedDict()
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
            found = self._failures.get(who)
        return max(0.0, found.wait_until - self._clock()) if found else 0.0

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
        if found is None or self._clock() > found.wait_until + FORGOTTEN_AFTER_S:
            return 0
        return found.count


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
