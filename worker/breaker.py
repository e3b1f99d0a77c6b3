"""Circuit breaker of a resource: one probe at a time while it does not serve."""

import logging
import threading
from collections.abc import Callable
from datetime import datetime
from enum import Enum

from store.columns import utc_now
from store.jobs import Dependency

log = logging.getLogger(__name__)

OPENS_AFTER = 3
FIRST_PAUSE_S = 0.5
LONGEST_PAUSE_S = 4.0


class _State(Enum):
    CLOSED = "closed"
    OPEN = "open"
    CHECKED = "checked"
    """The check passes again: one job may try."""
    TRIED = "tried"
    """One job tries."""


class Breaker:
    """Closed while a dependency serves; open, and in the way of what needs it, while it does not.

    It opens at once when the dependency's own check fails too, else after three faults without a success in
    between: one bad object is no outage. While it is open, a thread of its own checks, a few seconds apart at
    most. When the check passes one job tries, and its success closes the breaker for all.
    """

    def __init__(
        self,
        dependency: Dependency,
        check: Callable[[], None],
        *,
        faults: tuple[type[Exception], ...],
    ) -> None:
        self.dependency = dependency
        self.faults = faults
        self._check = check
        self._lock = threading.Lock()
        self._state = _State.CLOSED
        self._trier: int | None = None
        """The thread that was let through while it was open."""
        self._failures = 0
        self._pause_s = FIRST_PAUSE_S
        self._open_since: datetime | None = None

    @property
    def open_since(self) -> datetime | None:
        """When it opened; None while it is closed."""
        return self._open_since

    def permits(self) -> bool:
        """Return True if this thread may begin what needs it; one that is let through has to report."""
        with self._lock:
            if self._state is _State.CHECKED:
                self._state, self._trier = _State.TRIED, threading.get_ident()
                return True
            return self._state is _State.CLOSED

    def withdraw(self) -> None:
        """Report that this thread found nothing to do that needs it."""
        with self._lock:
            if self._tries():
                self._state, self._trier = _State.CHECKED, None

    def failed(self, error: Exception) -> None:
        """Report that it did not serve."""
        with self._lock:
            self._failures += 1
            doubted = self._state is _State.CLOSED and self._failures < OPENS_AFTER
        if doubted and self._serves():
            return
        with self._lock:
            if self._state is not _State.CLOSED and not self._tries():
                return
            if self._open_since is None:
                self._open_since = utc_now()
                log.warning("%s does not serve; what needs it waits: %s", self.dependency.label, error)
            self._state, self._trier = _State.OPEN, None
        threading.Thread(target=self._probe, name=f"probe-{self.dependency}", daemon=True).start()

    def served(self) -> bool:
        """Report that it served; whether that closed the breaker."""
        with self._lock:
            if self._state is not _State.CLOSED and not self._tries():
                # begun before it opened: no news
                return False
            since, self._open_since = self._open_since, None
            self._state, self._trier = _State.CLOSED, None
            self._failures, self._pause_s = 0, FIRST_PAUSE_S
        if since is None:
            return False
        away_s = (utc_now() - since).total_seconds()
        log.warning("%s serves again after %.0f s", self.dependency.label, away_s)
        return True

    def _tries(self) -> bool:
        return self._state is _State.TRIED and self._trier == threading.get_ident()

    def _probe(self) -> None:
        pause = threading.Event()
        while True:
            pause.wait(self._pause_s)
            self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)
            if self._serves():
                break
        with self._lock:
            self._state = _State.CHECKED

    def _serves(self) -> bool:
        try:
            self._check()
        except self.faults:
            return False
        return True
